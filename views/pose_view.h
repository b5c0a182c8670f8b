// PoseView: where a robot was at one of its nodes, for programs that show or export poses.
#pragma once

#include <cstdint>

#include "model/geometry.h"
#include "model/ids.h"

namespace moondb {

struct PoseView {
  NodeKey node;
  std::int64_t timestamp_ns = 0;  // When the robot was there: ns since 1970 UTC, by the robot's clock.
  Pose map_from_body;             // In the frame `map`: metres, z up.
  bool is_optimized = false;      // False: by odometry, since the last optimized pose or the start.
};

}  // namespace moondb
