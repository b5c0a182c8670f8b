// Finds the word that a command line stumbles over.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace moondb {

class Command;

// `unknown command "statsu"; did you mean "status"?` for the first word that is no subcommand where one is expected,
// or no option that exists; nothing if all words are known.
std::optional<std::string> DescribeMistyped(const Command& app, const std::vector<std::string>& words);

}  // namespace moondb
