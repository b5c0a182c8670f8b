// What a rover's stereo cameras make of the ground about it: one local traversability map a node.
//
// The cameras look forward and sweep over the turn that the rover makes at its node. Along every direction the line of
// sight over the terrain decides what is seen: rocks and crater rims hide what lies behind. Stereo depth has an error
// that grows with the square of the distance and is alike for neighbouring pixels, so what is far stands in the wrong
// place; far hazards are missed now and then, and far ground is taken for a hazard. Other rovers are obstacles. Now and
// then a whole obstacle is seen where none is.
// A cell is a hazard if a hazard was seen in it, else free if free ground was; coarse cells likewise, each layer by
// itself.
#pragma once

#include <vector>

#include "apps/moondb_mission/random.h"
#include "apps/moondb_mission/terrain.h"
#include "model/geometry.h"
#include "model/traversability_map.h"

namespace moondb {

struct CameraOptions {
  double ahead_m = 0.2;   // The map's frame stands here in the body's frame.
  double height_m = 0.4;  // Above the ground.
  double field_of_view_rad = 2.1;
  double range_min_m = 0.3;
  double range_max_m = 10;
  double depth_error_per_m = 0.004;  // Sigma of the distance = this * distance^2: 0.1 m at 5 m, 0.4 m at 10 m.
  double miss_share = 0.3;           // Of hazards at range_max; falls with the distance's square.
  double false_share = 0.01;         // Of patches of free ground, likewise.
  double phantom_share = 0.05;       // Of maps with an obstacle that is not there.
  double rover_radius_m = 0.35;      // Other rovers, seen as discs
  double rover_height_m = 0.35;      // of this height.
  int layer_count = 4;
  int cells_per_side = 100;
  std::uint32_t finest_resolution_um = 50'000;
};

// `map_from_body` is level; `turn_rad` is the turn made at the node, after the map's heading was taken.
TraversabilityMap Sense(const Terrain& terrain, NodeKey node, const Pose& map_from_body, double turn_rad,
                        const std::vector<Eigen::Vector2d>& other_rovers_m, const CameraOptions& options,
                        Random& random);

}  // namespace moondb
