#include "apps/moonctl/command_tree.h"

namespace moondb {
namespace {

std::vector<const Option*> OptionsThat(const Command& command, bool are_arguments) {
  std::vector<const Option*> chosen;
  for (const Option* option : command.options()) {
    if (option->is_argument() == are_arguments) chosen.push_back(option);
  }
  return chosen;
}

}  // namespace

const Command* FindSubcommand(const Command& command, const std::string& name) {
  for (const Command* sub : command.subcommands()) {
    if (sub->name() == name) return sub;
  }
  return nullptr;
}

const Command* FindCommand(const Command& root, const std::vector<std::string>& words) {
  const Command* command = &root;
  for (const std::string& word : words) {
    command = FindSubcommand(*command, word);
    if (command == nullptr) break;
  }
  return command;
}

std::string PathOf(const Command& command) {
  if (command.parent() == nullptr) return "";
  const std::string above = PathOf(*command.parent());
  return above.empty() ? command.name() : above + " " + command.name();
}

void VisitCommands(const Command& root, const std::function<void(const Command&)>& visit) {
  visit(root);
  for (const Command* sub : root.subcommands()) VisitCommands(*sub, visit);
}

const Command& GivenCommand(const Command& root) {
  const Command* command = &root;
  while (const Command* below = command->GivenSubcommand()) command = below;
  return *command;
}

const Option* FindOption(const Command& command, const std::string& word) {
  for (const Command* at = &command; at != nullptr; at = at->parent()) {
    if (const Option* option = at->FindOwnOption(OptionName(word))) return option;
  }
  return nullptr;
}

std::string OptionName(const std::string& word) { return word.substr(0, word.find('=')); }

std::vector<std::string> OptionNames(const Command& command) {
  std::vector<std::string> names;
  for (const Command* at = &command; at != nullptr; at = at->parent()) {
    for (const Option* option : at->options()) {
      for (const std::string& name : option->long_names()) names.push_back("--" + name);
    }
  }
  return names;
}

std::vector<const Option*> OwnOptions(const Command& command) { return OptionsThat(command, /*are_arguments=*/false); }

std::vector<const Option*> ArgumentsOf(const Command& command) { return OptionsThat(command, /*are_arguments=*/true); }

}  // namespace moondb
