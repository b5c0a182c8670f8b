// Maps that roll over one grid of the world by whole cells, as of a robot that keeps its map's heading.
//
// Every cell is known: a hazard where any of the terrain below it is one. Noise makes a share of all cells something
// else, each map and layer by itself. Layers double their resolution and lie about one middle.
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
