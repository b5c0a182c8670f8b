// Crop: chooses the part of a merged map that one export can hold.
//
// The centre is the median, in x and in y, of the origins' centres; the centre of an origin is the median of the
// centres of its items (maps and footprints). The items farthest from the centre are left out of the box until the box
// fits. The distance of an item is that of its farthest edge, in x or in y. An item is therefore kept, whatever other
// origins have, if all of it lies within half a side of the largest square that fits around the centre. One origin
// moves the centre at most to the neighbouring origin's.
//
// The result depends only on the set of items. Pure function, usable on any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "actors/merge/quantize.h"
#include "model/ids.h"

namespace moondb {

struct CropItem {
  AgentId origin = 0;
  CellBox box;
};

struct LeftOutOfCrop {
  std::size_t count = 0;
  std::int64_t distance_cells = 0;  // Distance of the nearest item of this origin that is left out.
};

struct Crop {
  CellBox box;                                // Bounding box of the kept items.
  std::map<AgentId, LeftOutOfCrop> left_out;  // By origin. Empty if the box of all items fits.
};

// A box fits if no side exceeds `side_cells_max`, and its area does not exceed `area_cells_max`.
Crop CropToFit(std::vector<CropItem> items, std::int64_t side_cells_max, std::int64_t area_cells_max);

}  // namespace moondb
