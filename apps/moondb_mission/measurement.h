// What a team measures of its own way: visual-inertial odometry and UWB ranges, with the errors of real ones.
//
// Odometry: per step white noise of 1 cm + 2 % of the step in x and y, 0.3 of that in z; yaw 0.002 rad + 0.005 rad/m +
// 1 % of the turn, roll and pitch a tenth of that; and a scale error of the rover's own, constant over the mission,
// which the stated covariance does not hold. Ranges: between antennas, with white noise, a constant bias of each pair,
// and bursts of measurements that are too long (no line of sight).
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
  double burst_share = 0.025;  // Chance of a burst at each measurement outside one.
  int burst_length_max = 4;
  double burst_mean_m = 1.5;
};

// The steps between a rover's consecutive nodes, given in order with their true poses.
std::vector<OdometryEdge> MeasureOdometry(const std::vector<GraphNode>& true_nodes, const OdometryOptions& options,
                                          Random& random);

// Ranges between all pairs of agents at every `every_nodes`-th node; a base station's node is always its 0.
// `truth` holds each rover's nodes from 0 and each base station's node 0; `period_ns` lies between nodes.
std::vector<RangeEdge> MeasureRanges(const std::vector<MissionAgent>& agents, const std::map<NodeKey, Pose>& truth,
                                     int node_count, std::int64_t period_ns, const RangeOptions& options,
                                     Random& random);

}  // namespace moondb
