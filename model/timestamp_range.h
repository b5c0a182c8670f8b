// A range of record timestamps.
#pragma once

#include <cstdint>

namespace moondb {

// Timestamps in ns since 1970 UTC, both ends inclusive.
struct TimestampRange {
  std::int64_t from_ns = INT64_MIN;
  std::int64_t to_ns = INT64_MAX;

  bool is_everything() const { return from_ns == INT64_MIN && to_ns == INT64_MAX; }
  bool Contains(std::int64_t timestamp_ns) const { return timestamp_ns >= from_ns && timestamp_ns <= to_ns; }
};

}  // namespace moondb
