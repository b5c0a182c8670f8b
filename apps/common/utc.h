// UTC time in text form. Plain functions, thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace moondb {

// Parses "2026-11-22T06:00Z" or "2026-11-22T06:00:30Z", from 1678 to 2261. Returns nothing for any other text.
std::optional<std::chrono::sys_seconds> ParseUtc(const std::string& text);

// Returns the nanoseconds since 1970 by this machine's clock.
std::int64_t UtcNowNs();

}  // namespace moondb
