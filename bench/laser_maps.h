// Local traversability maps as a rover with a scanning laser makes them in a building.
//
// A map holds one scan or several from a short way back. A beam makes the cells that it crosses free and the cell in
// which it ends a hazard, in each layer by itself: a hazard's coarser cell is always a hazard, while a thin line of
// cells differs from layer to layer.
#pragma once

#include <cstdint>
#include <vector>

#include "model/traversability_map.h"

namespace moondb {

// The maps of one drive through a building of its own, with a laser of its own, in order. The same seed gives the same.
std::vector<TraversabilityMap> MakeLaserMaps(std::uint64_t seed, int count);

}  // namespace moondb
