// How a team of rovers drives: each explores its own sector about the base station, around hazards and around the
// others.
//
// At each node a rover turns on the spot towards its next step and drives it straight; all steps of one period happen
// at the same time. A rover that would come too near another waits and looks around.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "apps/moondb_mission/random.h"
#include "apps/moondb_mission/route_map.h"
#include "apps/moondb_mission/terrain.h"

namespace moondb {

// One node of a rover: where it is, and the turn that it makes there before it drives on (0 at the last).
struct TrackPoint {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  double yaw_rad = 0;
  double turn_rad = 0;
};

struct DriveOptions {
  int rover_count = 3;
  int node_count = 61;           // Per rover.
  double rover_radius_m = 0.46;  // Around a body of 0.75 m x 0.5 m.
  double separation_m = 1.5;     // Between the middles of two rovers, at every instant.
  double step_min_m = 0.5;       // Steps are shorter where the way bends.
  double step_max_m = 1.0;
  double start_radius_m = 3;  // From the base station.
  double seen_radius_m = 3;   // What counts as explored.
};

// tracks[rover][node]. Every rover has node_count nodes; rovers start evenly about the base station, heading outwards.
std::vector<std::vector<TrackPoint>> DriveTeam(const Terrain& terrain, const DriveOptions& options, Random& random);

// The least distance of two rovers that drive from a to a_end and b to b_end in the same time.
double LeastDistance(const Eigen::Vector2d& a, const Eigen::Vector2d& a_end, const Eigen::Vector2d& b,
                     const Eigen::Vector2d& b_end);

}  // namespace moondb
