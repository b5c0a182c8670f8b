// The tree of moonctl's commands, as CLI11 holds it: what completion, the manual page and "did you mean" walk along.
// Plain functions; commands that the tree hides are not seen.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace moondb {

// In the order in which they were added.
std::vector<const CLI::App*> SubcommandsOf(const CLI::App& command);
const CLI::App* FindSubcommand(const CLI::App& command, const std::string& name);  // Null: none of that name.

// "role set"; empty for the root.
std::string PathOf(const CLI::App& command);

// Visits the root and everything below, each command before its subcommands.
void VisitCommands(const CLI::App& root, const std::function<void(const CLI::App&)>& visit);

// The option that `word` ("--json", "-a", "--watch=5") names at `command`: its own, or one of those above it. Null:
// none.
const CLI::Option* FindOption(const CLI::App& command, const std::string& word);
// "--json" of "--json=1".
std::string OptionName(const std::string& word);
// Whether the word behind it is its value.
bool TakesValue(const CLI::Option& option);

// "--agent", of a command and those above it.
std::vector<std::string> OptionNames(const CLI::App& command);

// The command's own, in the order in which they were added; arguments are those without a dash.
std::vector<const CLI::Option*> OwnOptions(const CLI::App& command);
std::vector<const CLI::Option*> ArgumentsOf(const CLI::App& command);

}  // namespace moondb
