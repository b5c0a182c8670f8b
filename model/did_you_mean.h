// ClosestWord: what a mistyped word was probably meant to be.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace moondb {

// Insertions, deletions, substitutions and swaps of neighbours that turn `a` into `b`.
std::size_t EditDistance(std::string_view a, std::string_view b);

// The nearest candidate (the first of equals) if at most a third of the word's letters, and at least one, may be wrong.
std::optional<std::string> ClosestWord(std::string_view word, const std::vector<std::string>& candidates);

// `; did you mean "address"?`, or nothing.
std::string DidYouMean(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace moondb
