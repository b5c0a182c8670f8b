// A common frame for maps that are to be compared by eye: the box of all their known cells. Plain functions.
#pragma once

#include <span>

#include "model/grid.h"

namespace moondb {

// Cells of the global grid, half-open. Empty where last <= first.
struct MapFrame {
  std::int64_t first_x = 0;
  std::int64_t first_y = 0;
  std::int64_t last_x = 0;
  std::int64_t last_y = 0;
  bool is_empty() const { return last_x <= first_x || last_y <= first_y; }
};

// The smallest frame that holds every known cell of all maps (of one resolution), and `margin_cells` around.
MapFrame FrameOf(std::span<const MergedMap* const> maps, std::int64_t margin_cells);

// The map in that frame; what it does not cover is unknown.
MergedMap InFrame(const MergedMap& map, const MapFrame& frame);

}  // namespace moondb
