// PoseCarrier: the valid pose of each node, with the correction of the last solve carried on to newer nodes.
//
// A node with an optimized pose lies there. A newer node of the same rover continues from the last such node n0 by
// odometry: optimized(n0) x raw(n0)^-1 x raw(n). Each node from n0 to n must have a raw pose, and each step must be at
// most kCarriedStep_m long. Otherwise odometry may have begun again, and the node has no valid pose until the next
// solve. Before the first optimized pose of a rover, raw poses are valid. Plain value.
#pragma once

#include <cstdint>
#include <optional>

#include "model/geometry.h"
#include "model/ids.h"

namespace moondb {

inline constexpr double kCarriedStep_m = 20;

enum class PoseSource { kRaw, kCarried, kOptimized };

struct ValidPose {
  Pose map_from_node;
  PoseSource source = PoseSource::kRaw;
  // True: the solve that the pose comes from could not place the rover in the frame `map`; the pose lies in a frame of
  // the rover's own. Always false for raw poses.
  bool is_unplaced = false;
};

class PoseCarrier {
 public:
  // Returns the valid pose of the next node; nullopt if it has none. `raw` and `optimized` are null if the pose is
  // unknown or a quarantine forbids its use. `is_unplaced`: of `optimized`. Requires: nodes come in ascending order.
  std::optional<ValidPose> Next(const NodeKey& node, const Pose* raw, const Pose* optimized, bool is_unplaced);

 private:
  struct Base {
    Pose map_from_odom;
    bool is_unplaced = false;
  };

  NodeKey last_;
  Eigen::Vector3d last_raw_position_m_ = Eigen::Vector3d::Zero();
  std::optional<Base> base_;   // From the rover's last node with both poses; nullopt before it.
  bool is_connected_ = false;  // True: odometry connects that node with `last_`.
};

}  // namespace moondb
