// Simulates a team's measurements of its motion: visual-inertial odometry and UWB ranges with realistic errors.
//
// Odometry has white noise. By default, its standard deviation per step is 1 cm + 2 % of the step in x and y, and 0.3
// of that in z. In yaw it is 0.002 rad + 0.005 rad/m + 1 % of the turn, and in roll and pitch a tenth of that. Each
// rover also has a constant scale error, which the covariances in the edges do not include.
//
// Ranges are measured between antennas. Ranges have white noise, a constant bias per pair of agents, and bursts of
// measurements that are too long because the line of sight is blocked.
#pragma once

#include <map>
#include <vector>

#include "apps/moondb_mission/random.h"
#include "model/mission.h"

namespace moondb {

struct OdometryOptions {
  double noise_m = 0.01;
  double noise_per_m = 0.02;
  double z_share = 0.3;
  double yaw_noise_rad = 0.002;
  double yaw_noise_rad_per_m = 0.005;
  double yaw_noise_per_rad = 0.01;
  double tilt_share = 0.1;
  double scale_sigma = 0.02;
};

struct RangeOptions {
  int every_nodes = 3;
  double range_max_m = 40;
  double sigma_m = 0.10;
  double bias_sigma_m = 0.10;
  double burst_share = 0.025;  // Probability that a burst starts at a measurement outside a burst.
  int burst_length_max = 4;
  double burst_mean_m = 1.5;
};

// Returns one odometry edge per pair of consecutive nodes. `true_nodes` are the nodes of one rover, in order, with true
// poses.
std::vector<OdometryEdge> MeasureOdometry(const std::vector<GraphNode>& true_nodes, const OdometryOptions& options,
                                          Random& random);

// Returns the ranges up to range_max_m between all pairs of agents, at every `every_nodes`-th node. Ranges to a base
// station refer to its node 0. `truth` holds each rover's nodes from 0 and each base station's node 0. `period_ns` is
// the time between nodes.
std::vector<RangeEdge> MeasureRanges(const std::vector<MissionAgent>& agents, const std::map<NodeKey, Pose>& truth,
                                     int node_count, std::int64_t period_ns, const RangeOptions& options,
                                     Random& random);

}  // namespace moondb
