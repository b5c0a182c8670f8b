#include "actors/pgo/initial_values.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace moondb {

namespace {

constexpr double kScaleErrorMax = 0.1;  // Five times SolverOptions::scale_sigma.
// If at least this fraction of the nodes has a pose from the last solution, the solve starts from the last solution's
// verdicts on ranges, without a robust stage.
constexpr double kWarmShare = 0.8;
constexpr double kWarmLengthMin_m = 5;  // Odometry over a shorter distance does not determine the scale.

// Returns true if `first` is at the configured start: `first` is the node of the start, or its raw pose is close to the
// start. Raw poses begin at the start. If nodes before `first` have not arrived yet, the raw pose of `first` is
// therefore usually far from the start.
bool IsAtStart(const CheckedNode& first, const AgentFacts& facts) {
  if (first.key.index == facts.start_index) return true;
  const double near_m = std::max(5 * facts.start_sigma_m, 0.5);
  return (first.raw.position_m - facts.start->position_m).norm() < near_m &&
         std::abs(std::remainder(first.raw.Yaw() - facts.start->Yaw(), 2 * M_PI)) < 0.2;
}

// Returns a pose with the position and yaw of `start`, and with the roll and pitch (the local slope) of `raw`.
Pose WithTiltOf(const Pose& start, const Pose& raw) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(start.Yaw() - raw.Yaw(), Eigen::Vector3d::UnitZ()));
  return Pose{start.position_m, (turn * raw.orientation).normalized()};
}

using Poses = std::vector<std::optional<Pose>>;

Pose Scaled(const Pose& step, double scale) { return Pose{(1 + scale) * step.position_m, step.orientation}; }

// Returns, for each node, the indices in graph.odometry of the edges at this node.
std::vector<std::vector<std::size_t>> FindTouching(const CheckedGraph& graph) {
  std::vector<std::vector<std::size_t>> touching(graph.nodes.size());
  for (std::size_t i = 0; i < graph.odometry.size(); ++i) {
    touching[graph.odometry[i].from].push_back(i);
    touching[graph.odometry[i].to].push_back(i);
  }
  return touching;
}

// Returns the rover's odometry scale error s by least squares over the steps between nodes that have a pose: minimises
// sum |d - (1 + s) t|^2, with d from the poses and t from odometry. Returns 0 if these steps are too short, or if the
// scale is fixed.
double EstimateScale(const CheckedGraph& graph, const Rover& rover, const Poses& poses) {
  if (graph.fixed_scales.contains(rover.agent)) return 0;
  double product_sum = 0;
  double square_sum = 0;
  double length_m = 0;
  for (const CheckedOdometry& odometry : graph.odometry) {
    if (odometry.from < rover.first || odometry.from >= rover.first + rover.count) continue;
    if (!poses[odometry.from] || !poses[odometry.to]) continue;
    const Eigen::Vector3d& step = odometry.from_from_to.position_m;
    product_sum += step.dot((poses[odometry.from]->Inverse() * *poses[odometry.to]).position_m);
    square_sum += step.squaredNorm();
    length_m += step.norm();
  }
  if (length_m < kWarmLengthMin_m) return 0;
  return std::clamp(product_sum / square_sum - 1, -kScaleErrorMax, kScaleErrorMax);
}

std::optional<Pose> FromNeighbour(const CheckedGraph& graph, const std::vector<std::size_t>& touching, std::size_t node,
                                  const Poses& poses, double scale) {
  for (const std::size_t i : touching) {
    const CheckedOdometry& odometry = graph.odometry[i];
    const Pose step = Scaled(odometry.from_from_to, scale);
    if (odometry.to == node && poses[odometry.from]) return *poses[odometry.from] * step;
    if (odometry.from == node && poses[odometry.to]) return *poses[odometry.to] * step.Inverse();
  }
  return std::nullopt;
}

void FillByRawDifference(const CheckedGraph& graph, const Rover& rover, std::size_t node, const Pose& start,
                         Poses& poses) {
  const auto from = [&](std::size_t known) {
    poses[node] = *poses[known] * (graph.nodes[known].raw.Inverse() * graph.nodes[node].raw);
  };
  if (node > rover.first) return from(node - 1);  // The pose of the preceding node is already filled.
  for (std::size_t known = node + 1; known < rover.first + rover.count; ++known) {
    if (poses[known]) return from(known);
  }
  poses[node] = start;
}

void FillRover(const CheckedGraph& graph, const Rover& rover, const Pose& start,
               const std::vector<std::vector<std::size_t>>& touching, double scale, Poses& poses) {
  const std::size_t end = rover.first + rover.count;
  for (std::size_t node = rover.first; node < end; ++node) {
    if (!poses[node]) poses[node] = FromNeighbour(graph, touching[node], node, poses, scale);
    if (!poses[node]) FillByRawDifference(graph, rover, node, start, poses);
  }
}

}  // namespace

StartPrior FindStartPrior(const CheckedNode& first, const AgentFactsMap& agents, const LoosePrior& loose) {
  const auto facts = agents.find(first.key.agent);
  if (facts == agents.end() || !facts->second.start || !IsAtStart(first, facts->second)) {
    return StartPrior{first.raw, loose.sigma_m, loose.sigma_rad, false};
  }
  const AgentFacts& known = facts->second;
  return StartPrior{WithTiltOf(*known.start, first.raw),
                    known.start_sigma_m > 0 ? known.start_sigma_m : AgentFacts{}.start_sigma_m,
                    known.start_sigma_rad > 0 ? known.start_sigma_rad : AgentFacts{}.start_sigma_rad, true};
}

InitialValues FindInitialValues(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                const std::vector<StartPrior>& starts, const std::map<NodeKey, Pose>& last_solution) {
  InitialValues result;
  Poses poses(graph.nodes.size());
  result.is_warm.assign(graph.nodes.size(), false);
  double warm_count = 0;
  double moving_count = 0;
  for (std::size_t node = 0; node < graph.nodes.size(); ++node) {
    if (graph.nodes[node].is_fixed) {
      poses[node] = graph.nodes[node].raw;
      continue;
    }
    ++moving_count;
    if (const auto last = last_solution.find(graph.nodes[node].key); last != last_solution.end()) {
      poses[node] = last->second;
      result.is_warm[node] = true;
      ++warm_count;
    }
  }
  result.has_warm = warm_count > 0;
  result.is_mostly_warm = warm_count > 0 && warm_count >= kWarmShare * moving_count;
  const std::vector<std::vector<std::size_t>> touching = FindTouching(graph);
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    result.scales.push_back(EstimateScale(graph, rovers[i], poses));
    FillRover(graph, rovers[i], starts[i].map_from_node, touching, result.scales.back(), poses);
  }
  for (const std::optional<Pose>& pose : poses) result.poses.push_back(*pose);
  return result;
}

PairNumbers EstimateBiases(const CheckedGraph& graph, const AgentFactsMap& agents, const std::vector<Pose>& poses,
                           const std::vector<bool>& counts, double bias_sigma_m) {
  struct Sums {
    double weights = 0;
    double errors = 0;
  };
  std::map<std::pair<AgentId, AgentId>, Sums> sums;
  for (std::size_t i = 0; i < graph.ranges.size(); ++i) {
    if (!counts[i]) continue;
    const CheckedRange& range = graph.ranges[i];
    const AgentId a = graph.nodes[range.from].key.agent;
    const AgentId b = graph.nodes[range.to].key.agent;
    const double distance_m =
        (poses[range.from] * AntennaOf(agents, a) - poses[range.to] * AntennaOf(agents, b)).norm();
    Sums& pair = sums[std::minmax(a, b)];
    pair.weights += 1 / range.edge->variance_m2;
    pair.errors += (range.edge->range_m - distance_m) / range.edge->variance_m2;
  }
  PairNumbers biases_m;
  for (const auto& [pair, sum] : sums) biases_m[pair] = sum.errors / (sum.weights + 1 / (bias_sigma_m * bias_sigma_m));
  return biases_m;
}

bool IsKnown(const CheckedGraph& graph, const InitialValues& initial, std::size_t node) {
  return initial.is_warm[node] || graph.nodes[node].is_fixed;
}

Eigen::Vector3d AntennaOf(const AgentFactsMap& agents, AgentId agent) {
  const auto facts = agents.find(agent);
  return facts == agents.end() ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : facts->second.antenna_m;
}

}  // namespace moondb
