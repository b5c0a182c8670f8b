// What a client and its agent's gateway both have to know of a ControlRequest.
#pragma once

#include "proto/control.pb.h"

namespace moondb {

// Its answer may take minutes: a solve, a merge (which all questions about the map may begin with), a whole file read,
// a bundle made, a wait for records.
inline bool TakesLong(const proto::ControlRequest& request) {
  return request.has_optimize() || request.has_merge() || request.has_map_why() || request.has_map_stats() ||
         request.has_map_tiles() || request.has_prune() || request.downlink().bytes_max() > 0 ||
         request.verify().part() == proto::VERIFY_PART_FILE || request.read().wait_s() > 0;
}

}  // namespace moondb
