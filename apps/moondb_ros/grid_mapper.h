// GridMapper: makes a node's local map from occupancy grids, such as a costmap or the map of slam_toolbox.
//
// Takes 100 x 100 cells around the robot from the newest grid of each topic. Values: 100 is a hazard, 0 is free, all
// others are unknown, because inflation is no observation. With several topics, each gives one layer. With one topic,
// coarser layers of twice the cell size follow, until a layer contains the whole grid: at most four layers in all. A
// coarser cell is a hazard if one of its four cells is, else free if one of them is. The map's axes are those of the
// grids' frame.
//
// Not thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "apps/moondb_ros/frame_tree.h"
#include "apps/moondb_ros/node_planner.h"
#include "apps/moondb_ros/odometry_track.h"
#include "apps/moondb_ros/ros_messages.h"
#include "model/error.h"
#include "model/traversability_map.h"

namespace moondb {

inline constexpr std::uint32_t kGridSideMax_cells = 4096;
inline constexpr double kGridAgeMax_s = 15;  // An older grid is not used. slam_toolbox sends its map each 5 s.

class GridMapper {
 public:
  // After this many grids of a topic in turn without an unknown cell, that topic's grids are refused.
  static constexpr int kFullyKnownMax = 20;

  explicit GridMapper(std::size_t topic_count) : topics_(topic_count) {}

  // Sets the newest grid of a topic. Fails with kInvalid, and keeps the last grid, if the grid
  //   - is rotated, or has sides that do not fit its values or exceed kGridSideMax_cells;
  //   - has cells outside of 0.01 to 1 m, or values outside of -1 to 100.
  // Also fails with kInvalid after kFullyKnownMax grids in turn without an unknown cell.
  Result<void> Set(std::size_t topic, RosGrid grid);

  // Returns the map of a node, whose key the caller sets. Fails with kNotFound if there is no grid, or no transform
  // joins the grids' frame to the robot at the grid's time; with kInvalid if grids have different frames.
  Result<TraversabilityMap> MapAt(const PlannedNode& node, const OdometryTrack& track, const FrameTree& frames) const;

 private:
  struct Topic {
    std::optional<RosGrid> newest;
    int fully_known_count = 0;  // Grids in turn without an unknown cell.
  };

  std::vector<Topic> topics_;
};

}  // namespace moondb
