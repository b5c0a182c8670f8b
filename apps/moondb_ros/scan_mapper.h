// ScanMapper: makes a node's local map from the laser scans of the last seconds.
//
// Each ray starts at the scanner, where odometry and /tf_static place it at the ray's time, and ends at the hazard that
// it hit. A cell is a hazard if at least half of the rays that enter it end there; it is free if rays cross it; all
// other cells are unknown. Unlike a costmap, a scan says which cells nobody saw.
//
// Not thread-safe. Keeps the newest kScansMax scans.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "apps/moondb_ros/frame_tree.h"
#include "apps/moondb_ros/node_planner.h"
#include "apps/moondb_ros/odometry_track.h"
#include "apps/moondb_ros/ros_messages.h"
#include "model/error.h"
#include "model/traversability_map.h"

namespace moondb {

inline constexpr double kScansUsed_s = 2;  // A map is made of the scans of this long before its node.
inline constexpr std::size_t kScansMax = 300;
inline constexpr std::size_t kRaysMax = 100'000;  // Rays of one scan.

class ScanMapper {
 public:
  // Adds a scan. Fails with kInvalid for more than kRaysMax rays, or for angles or limits of the range that are not
  // finite or not positive.
  Result<void> Add(RosScan scan);

  // Returns the map of a node, whose key the caller sets: layers of 100 x 100 cells of 5, 10, 20 and 40 cm around the
  // node, in its own frame. Ranges that are infinite or beyond range_max make cells free up to range_max; ranges that
  // are NaN or below range_min are skipped. Fails with kNotFound if there is no scan of these seconds, or if no
  // transform places them.
  Result<TraversabilityMap> MapAt(const PlannedNode& node, const OdometryTrack& track, const FrameTree& frames) const;

 private:
  std::deque<RosScan> scans_;
};

}  // namespace moondb
