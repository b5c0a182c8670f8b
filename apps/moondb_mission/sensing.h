// Simulates a rover's stereo cameras: makes one local traversability map of the surrounding terrain per node.
//
// The cameras look forward and sweep over the turn that the rover makes at its node. In every direction the line of
// sight over the terrain decides what is visible: rocks and crater rims hide the terrain behind them. The stereo depth
// error grows with the square of the distance and is similar for neighbouring pixels, so distant cells are displaced.
// Sometimes distant hazards are missed, and distant free terrain is classified as a hazard. Other rovers are obstacles.
// Some maps contain an obstacle that does not exist.
//
// A cell is a hazard if a hazard was seen in it. Otherwise it is free if free terrain was seen in it. Each layer
// follows this rule separately.
#pragma once

#include <vector>

#include "apps/moondb_mission/random.h"
#include "apps/moondb_mission/terrain.h"
#include "model/geometry.h"
#include "model/traversability_map.h"

namespace moondb {

struct CameraOptions {
  double ahead_m = 0.2;   // Distance of the map's frame ahead of the body's frame.
  double height_m = 0.4;  // Height of the cameras above the terrain.
  double field_of_view_rad = 2.1;
  double range_min_m = 0.3;
  double range_max_m = 10;
  // Sigma of a measured distance d is depth_error_per_m * d^2: 0.1 m at 5 m, 0.4 m at 10 m.
  double depth_error_per_m = 0.004;
  // Share of hazards missed at range_max_m. At other distances, the share is proportional to the distance squared.
  double miss_share = 0.3;
  // Share of free patches at range_max_m seen as hazards. At other distances, the share is proportional to the distance
  // squared.
  double false_share = 0.01;
  double phantom_share = 0.05;   // Share of maps with an obstacle that does not exist.
  double rover_radius_m = 0.35;  // Other rovers are discs of this radius.
  double rover_height_m = 0.35;  // Height of the other rovers.
  int layer_count = 4;
  int cells_per_side = 100;
  std::uint32_t finest_resolution_um = 50'000;
};

// Returns the map that a rover makes at `node`. Requires: `map_from_body`, the pose before the rover turns, is level.
// `turn_rad` is the turn that the rover makes at the node.
TraversabilityMap Sense(const Terrain& terrain, NodeKey node, const Pose& map_from_body, double turn_rad,
                        const std::vector<Eigen::Vector2d>& other_rovers_m, const CameraOptions& options,
                        Random& random);

}  // namespace moondb
