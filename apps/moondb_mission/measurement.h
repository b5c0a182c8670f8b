// Simulates a team's measurements of its motion: visual-inertial odometry and UWB ranges with realistic errors.
//
// Odometry has white noise per step. In x and y it is 1 cm + 2 % of the step, in z 0.3 of that. In yaw it is 0.002 rad
// + 0.005 rad/m + 1 % of the turn, in roll and pitch a tenth of that. Each rover also has a scale error that is
// constant over the mission. The stated covariance does not include it.
//
// Ranges are measured between antennas. They have white noise, a constant bias per pair, and bursts of measurements
// that are too long (no line of sight).
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

// Returns one odometry edge between each two consecutive nodes of one rover. `true_nodes` are in order and have true
// poses.
std::vector<OdometryEdge> MeasureOdometry(const std::vector<GraphNode>& true_nodes, const OdometryOptions& options,
                                          Random& random);

// Returns ranges between all pairs of agents at every `every_nodes`-th node. Ranges to a base station refer to its node
// 0. `truth` holds each rover's nodes from 0 and each base station's node 0. `period_ns` is the time between nodes.
std::vector<RangeEdge> MeasureRanges(const std::vector<MissionAgent>& agents, const std::map<NodeKey, Pose>& truth,
                                     int node_count, std::int64_t period_ns, const RangeOptions& options,
                                     Random& random);

}  // namespace moondb
