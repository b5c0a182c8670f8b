// MapView: a merged map as an occupancy grid, for programs that show or export maps. Thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "model/grid.h"

namespace moondb {

struct MapView {
  std::int64_t timestamp_ns = 0;  // The map holds what was measured until then (ns since 1970 UTC).
  MergedMap map;                  // In the frame `map`: metres.

  double resolution_m() const { return map.resolution_um * 1e-6; }
  // The lower left corner of the cell (0, 0).
  double origin_x_m() const { return static_cast<double>(map.origin_cell_x) * resolution_m(); }
  double origin_y_m() const { return static_cast<double>(map.origin_cell_y) * resolution_m(); }
  // The values of nav_msgs/OccupancyGrid, row by row from the smallest y: -1 unknown, 0 free, 100 hazard.
  std::vector<std::int8_t> Occupancy() const;
};

}  // namespace moondb
