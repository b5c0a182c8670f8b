// Generates local traversability maps like those that a rover with a scanning laser makes in a building.
//
// A map contains one scan, or several scans made a short distance apart. In each layer, a beam marks the cells that it
// crosses as free, and the cell in which it ends as a hazard. A coarse cell that contains a hazard of a finer layer is
// therefore also a hazard. If beams are drawn as thin lines, each layer has its own lines, so the free cells of two
// layers may differ.
#pragma once

#include <cstdint>
#include <vector>

#include "model/geometry.h"
#include "model/ids.h"
#include "model/traversability_map.h"

namespace moondb {

// Returns the maps of one drive, in order. The seed determines the building, the laser and the drive.
std::vector<TraversabilityMap> MakeLaserMaps(std::uint64_t seed, int count);

struct LaserMap {
  NodeKey node;  // The rover, and the number of its map.
  Pose pose;     // True pose of the map in the frame of the building.
  TraversabilityMap map;
};

// Returns the maps of rovers 1 to `rover_count` that drive in one building, with a map each `step_m`.
std::vector<LaserMap> MakeLaserDrives(std::uint64_t seed, int rover_count, int map_count, double step_m);

}  // namespace moondb
