// Parses and formats durations as people write them: "90" (seconds), "500ms", "1.5h", "7d".
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

namespace moondb {

// Parses a decimal number with a unit (ms, s, m, min, h or d) or without a unit (seconds). Returns nullopt for other
// text, for less than 1 ms, and for more than `longest`.
std::optional<std::chrono::milliseconds> ParseDuration(std::string_view text,
                                                       std::chrono::milliseconds longest = std::chrono::hours(24));

// Formats a duration in the largest unit that needs no fraction: "7d", "36h", "1500ms". ParseDuration can read the
// result.
std::string FormatDuration(std::chrono::milliseconds duration);

}  // namespace moondb
