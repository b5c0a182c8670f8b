// The world of merge_bench: rovers drive about the middle of a square with a side of `side_cells` cells of 5 cm. They
// make local maps of four layers of 128 x 128 cells, each layer twice as coarse as the one before.
//
// A layer knows about three quarters of the cells in a disc around the rover. The unknown cells are wedges in the
// shadow of rocks, and a few scattered cells. All known cells lie within the square.
#pragma once

#include <cstdint>
#include <vector>

#include "actors/merge/merge_maps.h"

namespace moondb {

struct MergeWorld {
  MergeGrid grid;
  std::vector<MapAtPose> maps;
  std::vector<Pose> footprints;  // One per map.
};

MergeWorld MakeMergeWorld(std::size_t map_count, std::int64_t side_cells, std::uint64_t seed);

}  // namespace moondb
