#include "apps/moonctl/completion.h"

#include "apps/moonctl/command_tree.h"
#include "model/text.h"

namespace moondb {
namespace {

// The role of the last word on the command line: the value of an option, or an argument or subcommand of `command`.
struct Cursor {
  const Command* command = nullptr;
  const Option* value_of = nullptr;  // The option whose value the last word is. Null: no option.
  int argument = 0;                  // Number of positional arguments before the last word.
};

Cursor FindCursor(const Command& root, const std::vector<std::string>& words) {
  Cursor cursor{&root};
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "=") continue;
    if (cursor.value_of != nullptr) {
      cursor.value_of = nullptr;
    } else if (word.starts_with("-")) {
      const Option* option = FindOption(*cursor.command, word);
      const bool is_open = option != nullptr && option->takes_value() && word.find('=') == std::string::npos;
      cursor.value_of = is_open ? option : nullptr;
    } else if (const Command* sub = FindSubcommand(*cursor.command, word)) {
      cursor = {sub};
    } else {
      ++cursor.argument;
    }
  }
  return cursor;
}

// Returns the positional argument to which the positional word number `place` (from 0) belongs. Each argument takes up
// to values_max() words. Null: the command takes fewer words.
const Option* ArgumentAt(const Command& command, int place) {
  for (const Option* argument : ArgumentsOf(command)) {
    place -= argument->values_max();
    if (place < 0) return argument;
  }
  return nullptr;
}

// Adds the candidates that the option's type name describes: "AGENT", "FILE", "TEXT:{ros,png}",
// "{AGENT,leader,survivor}".
void AddValues(const Option& option, const TeamWords& team, Completion& completion) {
  const std::string type = option.type_name();
  const std::size_t open = type.find('{');
  const bool is_list = open != std::string::npos;
  const std::string names = is_list ? type.substr(open + 1, type.find('}') - open - 1) : type;
  for (const std::string_view name : Split(names, ',')) {
    if (name == "FILE" || name == "FOLDER") {
      completion.is_file = true;
    } else if (name == "AGENT") {
      for (const std::string& agent : team.agents) completion.candidates.push_back({agent, "agent"});
    } else if (name == "DATATYPE") {
      for (const std::string& data_type : team.data_types) completion.candidates.push_back({data_type, "data type"});
    } else if (is_list) {
      completion.candidates.push_back({std::string(name), option.description()});
    }
  }
}

void AddOptions(const Command& command, Completion& completion) {
  for (const std::string& name : OptionNames(command)) {
    completion.candidates.push_back({name, FindOption(command, name)->description()});
  }
}

}  // namespace

Completion Complete(const Command& root, const std::vector<std::string>& words, const TeamWords& team) {
  const Cursor cursor = FindCursor(root, words);
  std::string typed = words.empty() || words.back() == "=" ? "" : words.back();
  std::string before;  // Text that each candidate keeps: "--agent=" if the last word is "--agent=ro".
  Completion all;
  const Option* option = cursor.value_of;
  if (option == nullptr && typed.starts_with("--") && typed.find('=') != std::string::npos) {
    option = FindOption(*cursor.command, typed);
    before = OptionName(typed) + "=";
    typed = typed.substr(before.size());
  }
  if (option != nullptr) {
    AddValues(*option, team, all);
  } else if (typed.starts_with("-")) {
    AddOptions(*cursor.command, all);
  } else {
    for (const Command* sub : cursor.command->subcommands()) {
      all.candidates.push_back({sub->name(), sub->description()});
    }
    if (const Option* argument = ArgumentAt(*cursor.command, cursor.argument)) AddValues(*argument, team, all);
  }
  Completion fitting;
  fitting.is_file = all.is_file;
  for (const Candidate& candidate : all.candidates) {
    if (candidate.word.starts_with(typed))
      fitting.candidates.push_back({before + candidate.word, candidate.description});
  }
  return fitting;
}

}  // namespace moondb
