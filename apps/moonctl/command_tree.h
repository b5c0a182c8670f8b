// Searches the tree of commands. Used by completion, the manual page and "did you mean".
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/common/arguments.h"

namespace moondb {

const Command* FindSubcommand(const Command& command, const std::string& name);  // Null: no subcommand has that name.

// Returns the command on the path `words`, such as {"role", "set"}. Returns the root if `words` is empty. Null: a word
// names no subcommand.
const Command* FindCommand(const Command& root, const std::vector<std::string>& words);

// Returns the command's path, such as "role set". Empty for the root.
std::string PathOf(const Command& command);

// Visits the root and all commands below it, each command before its subcommands.
void VisitCommands(const Command& root, const std::function<void(const Command&)>& visit);

// Returns the innermost command of the parsed command line: "set" of "role set". Returns the root if none is given.
const Command& GivenCommand(const Command& root);

// Returns the option that `word` ("--json", "-a", "--watch=5") names, among the options of `command` and its ancestors.
// Null: there is no such option.
const Option* FindOption(const Command& command, const std::string& word);
// Returns the name without the value: "--json" of "--json=1".
std::string OptionName(const std::string& word);

// Returns the long option names ("--agent") of a command and its ancestors.
std::vector<std::string> OptionNames(const Command& command);

// OwnOptions returns the options and ArgumentsOf the positional arguments of the command itself, in the order in which
// they were added.
std::vector<const Option*> OwnOptions(const Command& command);
std::vector<const Option*> ArgumentsOf(const Command& command);

}  // namespace moondb
