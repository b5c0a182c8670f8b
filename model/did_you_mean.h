// ClosestWord: suggests a correction for a mistyped word.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace moondb {

// Returns the number of insertions, deletions, substitutions and swaps of adjacent characters that turn `a` into `b`.
std::size_t EditDistance(std::string_view a, std::string_view b);

// Returns the candidate with the smallest EditDistance to the word; the first of them if there are several. Returns
// nullopt if that distance is more than 1 and more than a third of the word's length.
std::optional<std::string> ClosestWord(std::string_view word, const std::vector<std::string>& candidates);

// Returns `; did you mean "address"?` for the ClosestWord, or an empty string if there is none.
std::string DidYouMean(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace moondb
