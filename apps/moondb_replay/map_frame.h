// A common frame for maps that people compare side by side: the bounding box of all known cells.
#pragma once

#include <span>

#include "model/grid.h"

namespace moondb {

// A half-open range of cells of the global grid. Empty if last <= first.
struct MapFrame {
  std::int64_t first_x = 0;
  std::int64_t first_y = 0;
  std::int64_t last_x = 0;
  std::int64_t last_y = 0;
  bool is_empty() const { return last_x <= first_x || last_y <= first_y; }
};

// Returns the smallest frame that holds every known cell of all maps, plus `margin_cells` on each side. Requires: all
// maps have the same resolution.
MapFrame FrameOf(std::span<const MergedMap* const> maps, std::int64_t margin_cells);

// Returns the part of the map inside `frame`. Cells outside the map are unknown.
MergedMap InFrame(const MergedMap& map, const MapFrame& frame);

}  // namespace moondb
