// Draws the local maps of two nodes over each other, for `moonctl map overlap`.
//
// Pictures are in the frame of the first map, whose x and y axes lie in the plane. Cells are 5 cm wide. Both maps are
// drawn from the finest layer that knows a place.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "actors/registration/map_matching.h"
#include "apps/picture/picture.h"
#include "model/error.h"
#include "model/geometry.h"
#include "model/traversability_map.h"

namespace moondb {

// Two maps at the poses of their nodes.
struct MapPlacement {
  std::string name;  // Names the source of the poses: "odometry".
  Pose map_from_first_node;
  Pose map_from_second_node;
};

// The hazards of the first map that lie in the known area of the second map.
struct OverlapShare {
  std::size_t common_count = 0;
  std::size_t matched_count = 0;  // Number of these hazards with a hazard of the second map within 10 cm.

  // Returns nullopt if the maps have no common hazard.
  std::optional<double> ratio() const;
};

// Two maps to be drawn, and the names of their nodes.
struct OverlaidMaps {
  TraversabilityMap first;
  TraversabilityMap second;
  std::string first_name;
  std::string second_name;
};

// Everything that the pictures need.
struct Overlap {
  OverlaidMaps maps;
  std::vector<MapPlacement> placements;
  std::vector<std::string> remarks;
};

// Returns first_from_second, the relative pose of two maps in the plane.
PlanarOffset OffsetOf(const OverlaidMaps& maps, const MapPlacement& placement);

// Counts hazards as the matching of maps does: layers coarser than 20 cm are not used (HazardField).
OverlapShare MeasureOverlap(const OverlaidMaps& maps, const PlanarOffset& first_from_second);

// Returns a raster with the values of `classes`: unknown, free, hazard of the first map, hazard of the second map, and
// hazard of both. It covers the known cells of both maps, as far as they lie within 30 m of the middle of the first
// map, along each axis.
Raster OverlapRaster(const OverlaidMaps& maps, const PlanarOffset& first_from_second);

// Returns a panel for each placement, with the share in its title. `north_yaw_rad`: the direction of north in the frame
// of the first map.
Picture OverlapPicture(const OverlaidMaps& maps, const std::vector<MapPlacement>& placements, double north_yaw_rad);

}  // namespace moondb
