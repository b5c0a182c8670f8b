// What storage and whoever plans its pruning both have to know.
#pragma once

#include "model/ids.h"
#include "proto/types.pb.h"

namespace moondb {

inline constexpr double kPruneAgeMax_s = 1e9;  // 30 years.

// Types that are pruned only where they are named: their records hang together. A graph without some of its nodes is
// broken, and a map without its quarantine counts again.
inline bool IsKeptUnlessNamed(DataType type) {
  switch (type) {
    case proto::POSE_GRAPH_NODE:
    case proto::POSE_GRAPH_EDGE:
    case proto::OPTIMIZED_POSE:
    case proto::EDGE_VERDICT:
    case proto::MAP_QUARANTINE:
      return true;
    default:
      return false;
  }
}

}  // namespace moondb
