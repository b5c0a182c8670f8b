// Parses UTC times and reads this machine's clock. Thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace moondb {

// Parses a time such as "2026-11-22T06:00Z" or "2026-11-22T06:00:30Z", in the years 1678 to 2261. Returns nothing for
// any other text.
std::optional<std::chrono::sys_seconds> ParseUtc(const std::string& text);

// Returns the nanoseconds since 1970 by this machine's clock.
std::int64_t UtcNowNs();

}  // namespace moondb
