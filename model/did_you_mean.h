// ClosestWord: suggests a correction for a mistyped word.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace moondb {

// Returns the number of insertions, deletions, substitutions and swaps of neighbours that turn `a` into `b`.
std::size_t EditDistance(std::string_view a, std::string_view b);

// Returns the nearest candidate, the first of equals. The distance must be at most a third of the word's length, but 1
// is always allowed.
std::optional<std::string> ClosestWord(std::string_view word, const std::vector<std::string>& candidates);

// Returns `; did you mean "address"?`, or an empty string.
std::string DidYouMean(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace moondb
