#include "views/map_view.h"

namespace moondb {
namespace {

std::int8_t OccupancyOf(Cell cell) {
  switch (cell) {
    case Cell::kFree:
      return 0;
    case Cell::kHazard:
      return 100;
    case Cell::kUnknown:
      break;
  }
  return -1;
}

}  // namespace

std::vector<std::int8_t> MapView::Occupancy() const {
  std::vector<std::int8_t> values;
  values.reserve(map.grid.cells.size());
  for (const Cell cell : map.grid.cells) values.push_back(OccupancyOf(cell));
  return values;
}

}  // namespace moondb
