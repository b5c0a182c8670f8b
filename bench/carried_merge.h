// Measures what an agent does for one new record of the merged map: from the record to the updated tiles, through
// MapCollection and Merger, as MergeActor does (docs/benchmarks/merging.md).
#pragma once

#include <cstddef>

#include "bench/merge_world.h"
#include "model/error.h"

namespace moondb {

// Medians, on one thread.
struct CarriedMerge {
  double new_map_ms = 0;     // A new node, which is carried, and its map.
  double moved_pose_ms = 0;  // A new optimised pose, with kCarriedNodes nodes carried on from it, each with a map.
};

inline constexpr std::size_t kCarriedNodes = 100;

// Requires: the world has more than kCarriedNodes maps.
Result<CarriedMerge> MeasureCarriedMerge(const MergeWorld& world, int repetitions);

}  // namespace moondb
