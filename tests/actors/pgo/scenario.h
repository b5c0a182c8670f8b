// Scenario: a small team that drives over hills, drawn from a seed. Tests compare the solver's poses with the
// scenario's true poses.
#pragma once

#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "model/pose_graph.h"

namespace moondb::simulation {

struct ScenarioOptions {
  std::uint64_t seed = 1;
  int rover_count = 3;   // Rovers are agents 1 to rover_count. The base station is agent rover_count + 1.
  int node_count = 100;  // Nodes per rover.
  double step_m = 1;
  int range_every = 4;  // Number of nodes from one range to the next.
  double range_sigma_m = 0.10;
  double outlier_ratio = 0;  // Share of ranges that are too long by outlier_min_m to outlier_max_m.
  double outlier_min_m = 1;
  double outlier_max_m = 5;
  double correlation = 0;  // Correlation of a pair's consecutive range errors. Their sigma is range_sigma_m.
  std::vector<double> scale_errors = {};  // Scale error of each rover. Rovers beyond the list have none.
  double step_noise_m = 0.02;             // Sigma of a step in x and y. The sigma in z is half as large.
  double yaw_noise_rad = 0.004;           // Sigma of the yaw of a step.
  // Sigma of the roll and pitch of a step. The roll and pitch of raw poses follow gravity, with a sigma of 0.01 rad.
  double tilt_noise_rad = 0.002;
  double bias_sigma_m = 0;  // Sigma of each pair's range bias.
  Eigen::Vector3d antenna_m = Eigen::Vector3d(0.3, 0.2, 0.5);
  bool has_base_station = true;
  double start_sigma_m = 0.05;  // Sigma of the configured start positions.
  double start_sigma_rad = 0.01;
  // If true, each rover circles in its own sector around the base station. If false, all rovers start in one line and
  // drive wide arcs. In that case only the start poses determine the team's rotation around the base station.
  bool is_around_base = false;
};

struct Scenario {
  PoseGraph graph;
  AgentFactsMap agents;
  std::map<NodeKey, Pose> truth;  // True poses of the rovers.
  std::vector<bool> is_outlier;   // One entry for each of graph.ranges.
};

Scenario MakeScenario(const ScenarioOptions& options);

// Sigmas of the measurements that LoopClosureOf and PriorOf draw.
inline constexpr double kClosureSigma_m = 0.05;
inline constexpr double kClosureSigma_rad = 0.01;

// Draws a loop closure between two nodes from their true poses, with an additional offset of the measured position.
LoopClosure LoopClosureOf(const Scenario& scenario, const NodeKey& from, const NodeKey& to, const std::string& source,
                          std::mt19937_64& rng, const Eigen::Vector3d& offset_m = Eigen::Vector3d::Zero());

// Draws a prior of a node from its true pose. Its map_from_node has the full true orientation whatever the extent.
NodePrior PriorOf(const Scenario& scenario, const NodeKey& node, PriorExtent extent, const std::string& source,
                  std::mt19937_64& rng);

// Returns the root mean square distance between `poses` and the true positions, over all rovers' nodes.
double TrajectoryErrorM(const Scenario& scenario, const std::map<NodeKey, Pose>& poses);

}  // namespace moondb::simulation
