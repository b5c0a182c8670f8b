// Converts occupancies and costs of other programs to the cells of local maps. Thread-safe.
#pragma once

#include <span>
#include <vector>

#include "model/error.h"
#include "model/grid.h"

namespace moondb {

// Which values of a grid are unknown, and from which value on a cell is a hazard. All other values from 0 to 255 are
// free. For nav_msgs/OccupancyGrid use {{-1}, 65}; for the costs of a Nav2 costmap (0 to 255, without its inflation
// layer) use {{255}, 254}.
struct OccupancyValues {
  std::vector<int> unknown = {-1};
  int hazard_from = 65;
};

// Returns the cells in the order of `grid`. Fails with kInvalid if a value is neither unknown nor from 0 to 255; the
// error's field is "grid[i]".
Result<std::vector<Cell>> CellsOfOccupancy(std::span<const int> grid, const OccupancyValues& values = {});

}  // namespace moondb
