#include "apps/moondb_mission/measurement.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace moondb {

namespace {

Eigen::Quaterniond SmallTurn(const Eigen::Vector3d& turn_rad) {
  const double angle = turn_rad.norm();
  if (angle == 0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn_rad / angle));
}

// Errors of the ranges between two radios in addition to white noise: a constant bias, and the number of measurements
// left in the current burst.
struct PairState {
  double bias_m = 0;
  int burst_left = 0;
};

Eigen::Vector3d AntennaOf(const MissionAgent& agent, const std::map<NodeKey, Pose>& truth, std::uint64_t node) {
  return truth.at(NodeKey{agent.id, agent.is_base_station ? 0 : node}) * agent.antenna_m;
}

double DrawExcess(PairState& pair, const RangeOptions& options, Random& random) {
  if (pair.burst_left == 0 && random.Chance(options.burst_share)) {
    pair.burst_left = 1 + random.Index(options.burst_length_max);
  }
  if (pair.burst_left == 0) return 0;
  --pair.burst_left;
  return random.Exponential(options.burst_mean_m);
}

}  // namespace

std::vector<OdometryEdge> MeasureOdometry(const std::vector<GraphNode>& true_nodes, const OdometryOptions& options,
                                          Random& random) {
  std::vector<OdometryEdge> edges;
  const double scale = 1 + options.scale_sigma * random.Normal();
  for (std::size_t i = 1; i < true_nodes.size(); ++i) {
    const Pose step = true_nodes[i - 1].map_from_node.Inverse() * true_nodes[i].map_from_node;
    const double length_m = step.position_m.norm();
    const double sigma_m = options.noise_m + options.noise_per_m * length_m;
    const double yaw_sigma_rad = options.yaw_noise_rad + options.yaw_noise_rad_per_m * length_m +
                                 options.yaw_noise_per_rad * std::abs(step.Yaw());
    Eigen::Matrix<double, 6, 1> sigmas;
    sigmas << sigma_m, sigma_m, options.z_share * sigma_m, options.tilt_share * yaw_sigma_rad,
        options.tilt_share * yaw_sigma_rad, yaw_sigma_rad;
    Eigen::Matrix<double, 6, 1> noise;
    for (int k = 0; k < 6; ++k) noise[k] = sigmas[k] * random.Normal();
    OdometryEdge edge{true_nodes[i - 1].key, true_nodes[i].key, true_nodes[i].timestamp_ns, step, Matrix6d::Zero()};
    edge.from_from_to.position_m = step.position_m * scale + noise.head<3>();
    edge.from_from_to.orientation = (step.orientation * SmallTurn(noise.tail<3>())).normalized();
    edge.covariance.diagonal() = sigmas.cwiseAbs2();
    edges.push_back(edge);
  }
  return edges;
}

std::vector<RangeEdge> MeasureRanges(const std::vector<MissionAgent>& agents, const std::map<NodeKey, Pose>& truth,
                                     int node_count, std::int64_t period_ns, const RangeOptions& options,
                                     Random& random) {
  std::vector<RangeEdge> ranges;
  std::map<std::pair<AgentId, AgentId>, PairState> pairs;
  for (std::size_t a = 0; a < agents.size(); ++a) {
    for (std::size_t b = a + 1; b < agents.size(); ++b) {
      pairs[{agents[a].id, agents[b].id}].bias_m = options.bias_sigma_m * random.Normal();
    }
  }
  for (int node = 0; node < node_count; node += options.every_nodes) {
    const auto index = static_cast<std::uint64_t>(node);
    for (std::size_t a = 0; a < agents.size(); ++a) {
      for (std::size_t b = a + 1; b < agents.size(); ++b) {
        const double true_m = (AntennaOf(agents[a], truth, index) - AntennaOf(agents[b], truth, index)).norm();
        if (true_m >= options.range_max_m) continue;
        PairState& pair = pairs[{agents[a].id, agents[b].id}];
        const double measured_m =
            true_m + pair.bias_m + options.sigma_m * random.Normal() + DrawExcess(pair, options, random);
        ranges.push_back(RangeEdge{{agents[a].id, agents[a].is_base_station ? 0 : index},
                                   {agents[b].id, agents[b].is_base_station ? 0 : index},
                                   node * period_ns,
                                   std::max(0.0, measured_m),
                                   options.sigma_m * options.sigma_m});
      }
    }
  }
  return ranges;
}

}  // namespace moondb
