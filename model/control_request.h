// What a client and its agent's gateway both have to know of a ControlRequest.
#pragma once

#include <algorithm>
#include <chrono>

#include "proto/control.pb.h"

namespace moondb {

inline constexpr double kReadWaitMax_s = 60;

// Its answer may take minutes: a solve, a merge (which all questions about the map may begin with), a whole file read,
// a bundle made.
inline bool TakesLong(const proto::ControlRequest& request) {
  return request.has_optimize() || request.has_merge() || request.has_map_why() || request.has_map_stats() ||
         request.has_map_tiles() || request.has_prune() || request.downlink().bytes_max() > 0 ||
         request.verify().part() == proto::VERIFY_PART_FILE;
}

// How long the agent may wait for records before it answers a read; 0 for all else.
inline std::chrono::milliseconds WaitOf(const proto::ControlRequest& request) {
  const double wait_s = request.read().wait_s();
  if (!(wait_s > 0)) return {};  // NaN too.
  return std::chrono::milliseconds(static_cast<int>(1000 * std::min(wait_s, kReadWaitMax_s)));
}

}  // namespace moondb
