// Drives a team of rovers: each rover explores its own sector around the base station and avoids hazards and other
// rovers.
//
// At each node a rover turns on the spot towards its next step and then drives straight. All rovers drive their steps
// of one period simultaneously. A rover that would come nearer than separation_m to another rover waits and looks
// around.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "apps/moondb_mission/random.h"
#include "apps/moondb_mission/route_map.h"
#include "apps/moondb_mission/terrain.h"

namespace moondb {

// One node of a rover: its pose, and the turn that the rover makes there before it drives on (0 at the last node).
struct TrackPoint {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double yaw_rad = 0;
  double turn_rad = 0;
};

struct DriveOptions {
  int rover_count = 3;
  int node_count = 61;           // Number of nodes of each rover.
  double rover_radius_m = 0.46;  // Radius of a circle around a body of 0.75 m x 0.5 m.
  double separation_m = 1.5;     // Least distance between the centres of two rovers at any time.
  double step_min_m = 0.5;       // A step that ends at a bend of the route may be shorter.
  double step_max_m = 1.0;
  double start_radius_m = 3;  // Distance of the rovers' starts from the base station.
  double seen_radius_m = 3;   // Cells within this distance count as explored.
};

// Returns tracks[rover][node]. Every rover has node_count nodes. The rovers start evenly spaced around the base
// station, heading outwards.
std::vector<std::vector<TrackPoint>> DriveTeam(const Terrain& terrain, const DriveOptions& options, Random& random);

// Returns the least distance between two rovers that drive from a to a_end and from b to b_end in the same time.
double LeastDistance(const Eigen::Vector2d& a, const Eigen::Vector2d& a_end, const Eigen::Vector2d& b,
                     const Eigen::Vector2d& b_end);

}  // namespace moondb
