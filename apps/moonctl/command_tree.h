// Walks over the tree of commands, for completion, the manual page and "did you mean". Plain functions.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/common/arguments.h"

namespace moondb {

const Command* FindSubcommand(const Command& command, const std::string& name);  // Null: none of that name.

// The command that these words name one after the other: {"role", "set"}. The root for no words; null where one names
// none.
const Command* FindCommand(const Command& root, const std::vector<std::string>& words);

// "role set"; empty for the root.
std::string PathOf(const Command& command);

// Visits the root and everything below, each command before its subcommands.
void VisitCommands(const Command& root, const std::function<void(const Command&)>& visit);

// The command that the parsed command line gives last: "set" of "role set". The root if it gives none.
const Command& GivenCommand(const Command& root);

// The option that `word` ("--json", "-a", "--watch=5") names at `command`: its own, or one of those above it. Null:
// none.
const Option* FindOption(const Command& command, const std::string& word);
// "--json" of "--json=1".
std::string OptionName(const std::string& word);

// "--agent", of a command and those above it.
std::vector<std::string> OptionNames(const Command& command);

// The command's own, in the order in which they were added; arguments are those without a dash.
std::vector<const Option*> OwnOptions(const Command& command);
std::vector<const Option*> ArgumentsOf(const Command& command);

}  // namespace moondb
