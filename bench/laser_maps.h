// Generates local traversability maps like those that a rover with a scanning laser makes in a building.
//
// A map contains one scan, or several scans made a short distance apart. A beam marks the cells that it crosses as
// free, and the cell in which it ends as a hazard. This is done in each layer separately. The coarser cell above a
// hazard is therefore always a hazard, but the thin lines of free cells differ between layers.
#pragma once

#include <cstdint>
#include <vector>

#include "model/traversability_map.h"

namespace moondb {

// Returns the maps of one drive, in order. The seed determines the building, the laser and the drive.
std::vector<TraversabilityMap> MakeLaserMaps(std::uint64_t seed, int count);

}  // namespace moondb
