// Durations as people write them: "90" (seconds), "500ms", "1.5h", "7d". Plain functions.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

namespace moondb {

// A decimal number and a unit: ms, s, m or min, h, d; without one they are seconds. Nothing for anything else, for 0
// and less, and for more than `longest`.
std::optional<std::chrono::milliseconds> ParseDuration(std::string_view text,
                                                       std::chrono::milliseconds longest = std::chrono::hours(24));

// Whole, in the largest unit that needs no fraction: "7d", "36h", "1500ms". ParseDuration reads it back.
std::string FormatDuration(std::chrono::milliseconds duration);

}  // namespace moondb
