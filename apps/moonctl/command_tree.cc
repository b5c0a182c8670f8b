#include "apps/moonctl/command_tree.h"

#include <CLI/CLI.hpp>

namespace moondb {

std::vector<const CLI::App*> SubcommandsOf(const CLI::App& command) {
  return command.get_subcommands([](const CLI::App* sub) { return !sub->get_name().empty(); });
}

const CLI::App* FindSubcommand(const CLI::App& command, const std::string& name) {
  for (const CLI::App* sub : SubcommandsOf(command)) {
    if (sub->get_name() == name) return sub;
  }
  return nullptr;
}

std::string PathOf(const CLI::App& command) {
  if (command.get_parent() == nullptr) return "";
  const std::string above = PathOf(*command.get_parent());
  return above.empty() ? command.get_name() : above + " " + command.get_name();
}

void VisitCommands(const CLI::App& root, const std::function<void(const CLI::App&)>& visit) {
  visit(root);
  for (const CLI::App* sub : SubcommandsOf(root)) VisitCommands(*sub, visit);
}

const CLI::Option* FindOption(const CLI::App& command, const std::string& word) {
  for (const CLI::App* at = &command; at != nullptr; at = at->get_parent()) {
    if (const CLI::Option* option = at->get_option_no_throw(OptionName(word))) return option;
  }
  return nullptr;
}

std::string OptionName(const std::string& word) { return word.substr(0, word.find('=')); }

bool TakesValue(const CLI::Option& option) { return option.get_expected_min() > 0; }

std::vector<std::string> OptionNames(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::App* at = &command; at != nullptr; at = at->get_parent()) {
    for (const CLI::Option* option : at->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  return names;
}

std::vector<const CLI::Option*> OwnOptions(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) { return option->nonpositional(); });
}

std::vector<const CLI::Option*> ArgumentsOf(const CLI::App& command) {
  return command.get_options([](const CLI::Option* option) { return option->get_positional(); });
}

}  // namespace moondb
