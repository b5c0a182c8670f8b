// The world of merge_bench: rovers drive about the middle of a square of so many cells of 5 cm, and make local maps of
// four layers of 128 x 128 cells, each twice as coarse as the one before.
//
// A layer knows a disc around the rover, but for wedges in the shadow of rocks and a few cells here and there, about
// three cells in four of the disc. Everything known lies within the square.
#pragma once

#include <cstdint>
#include <vector>

#include "actors/merge/merge_maps.h"

namespace moondb {

struct MergeWorld {
  MergeGrid grid;
  std::vector<MapAtPose> maps;
  std::vector<Pose> footprints;  // One a map.
};

MergeWorld MakeMergeWorld(std::size_t map_count, std::int64_t side_cells, std::uint64_t seed);

}  // namespace moondb
