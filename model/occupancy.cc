#include "model/occupancy.h"

#include <algorithm>
#include <string>

namespace moondb {

Result<std::vector<Cell>> CellsOfOccupancy(std::span<const int> grid, const OccupancyValues& values) {
  std::vector<Cell> cells;
  cells.reserve(grid.size());
  for (const int value : grid) {
    if (std::find(values.unknown.begin(), values.unknown.end(), value) != values.unknown.end()) {
      cells.push_back(Cell::kUnknown);
    } else if (value >= 0 && value <= 255) {
      cells.push_back(value >= values.hazard_from ? Cell::kHazard : Cell::kFree);
    } else {
      return Fail(ErrorCode::kInvalid,
                  "is " + std::to_string(value) + "; an occupancy or cost lies between 0 and 255, or is unknown",
                  "grid[" + std::to_string(cells.size()) + "]");
    }
  }
  return cells;
}

}  // namespace moondb
