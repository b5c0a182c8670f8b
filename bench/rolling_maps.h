// Generates rolling maps: each map has moved by whole cells over a fixed grid of the world, and keeps its orientation.
//
// Every cell is known. It is a hazard if any part of the terrain in it is a hazard. Noise changes a fraction of all
// cells to another value, independently in each map and layer. The cell size doubles from layer to layer, and all
// layers have the same middle.
#pragma once

#include <cstdint>
#include <vector>

#include "model/traversability_map.h"

namespace moondb {

struct RollingOptions {
  std::uint64_t seed = 1;
  int map_count = 300;
  int layer_count = 4;
  int cells_per_side = 128;
  double step_m = 0.5;
  double noise_share = 0.01;
};

std::vector<TraversabilityMap> MakeRollingMaps(const RollingOptions& options);

}  // namespace moondb
