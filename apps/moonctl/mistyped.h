// Finds the unknown word in a command line that could not be parsed.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace moondb {

class Command;

// Returns `unknown command "statsu"; did you mean "status"?` for the first word that is an unknown subcommand or an
// unknown option. Returns nothing if all words are known.
std::optional<std::string> DescribeMistyped(const Command& app, const std::vector<std::string>& words);

}  // namespace moondb
