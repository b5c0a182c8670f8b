// Time of day as people write it, in UTC. Plain functions, any thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace moondb {

// "2026-11-22T06:00Z", "2026-11-22T06:00:30Z", from 1678 to 2261; nothing for anything else.
std::optional<std::chrono::sys_seconds> ParseUtc(const std::string& text);

// Nanoseconds since 1970, by this machine's clock.
std::int64_t UtcNowNs();

}  // namespace moondb
