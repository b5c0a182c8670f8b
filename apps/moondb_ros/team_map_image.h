// TeamMapImage: the merged map of an agent as a ROS occupancy grid, assembled from tiles (client/merged_map.h).
//
// Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "apps/moondb_ros/ros_messages.h"
#include "client/merged_map.h"
#include "model/grid.h"

namespace moondb {

class TeamMapImage {
 public:
  // The grid's origin lies at a multiple of this many cells, so that it seldom moves while the map grows.
  static constexpr std::int64_t kBlock_cells = 64;
  static constexpr std::int64_t kSideMax_cells = 4096;

  // Adds tiles. Returns whether a cell changed.
  bool Add(const MergedTiles& tiles);

  struct Picture {
    RosGrid grid;             // Without timestamp and frame.
    bool is_partial = false;  // The map is larger than kSideMax_cells a side; the grid is the part around the robot.
  };
  // Returns the part of the map that contains all known cells; nullopt if no cell is known. Cells: -1 unknown, 0 free,
  // 100 hazard. A map of more than kSideMax_cells a side is cut to that size around `robot_m` (frame of the map).
  std::optional<Picture> ToGrid(const Eigen::Vector2d& robot_m) const;

 private:
  struct Tile {
    std::int64_t left_cell = 0;  // Column and row of the tile's first cell in the merged map.
    std::int64_t bottom_cell = 0;
    Grid grid;
  };

  std::map<std::pair<std::int64_t, std::int64_t>, Tile> tiles_;  // Tiles with known cells, by column and row.
  std::uint32_t resolution_um_ = 0;
};

}  // namespace moondb
