// Scenario: a small team that drives over hills, drawn from a seed. Tests compare the solver's poses with the
// scenario's true poses.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "model/pose_graph.h"

namespace moondb::simulation {

struct ScenarioOptions {
  std::uint64_t seed = 1;
  int rover_count = 3;   // Agents 1 to rover_count; the base station is the next one.
  int node_count = 100;  // Nodes of each rover.
  double step_m = 1;
  int range_every = 4;  // Number of nodes from one range to the next.
  double range_sigma_m = 0.10;
  double outlier_ratio = 0;  // Share of ranges that are too long by outlier_min_m to outlier_max_m.
  double outlier_min_m = 1;
  double outlier_max_m = 5;
  double correlation = 0;  // Correlation of a pair's consecutive range errors, whose sigma stays range_sigma_m.
  std::vector<double> scale_errors = {};  // Scale error s of each rover. 0 for rovers beyond the list.
  double step_noise_m = 0.02;             // Sigma per step in x and y; half of it in z.
  double yaw_noise_rad = 0.004;           // Sigma per step.
  double tilt_noise_rad = 0.002;  // Sigma per odometry step. The tilt of raw poses follows gravity within 0.01 rad.
  double bias_sigma_m = 0;        // Sigma of each pair's range bias.
  Eigen::Vector3d antenna_m = Eigen::Vector3d(0.3, 0.2, 0.5);
  bool has_base_station = true;
  double start_sigma_m = 0.05;  // Error of the configured start positions.
  double start_sigma_rad = 0.01;
  // If true, each rover circles in its own sector about the base station. Otherwise all rovers start in one line and
  // drive wide arcs; only their start poses then determine a rotation of the whole team about the base station.
  bool is_around_base = false;
};

struct Scenario {
  PoseGraph graph;
  AgentFactsMap agents;
  std::map<NodeKey, Pose> truth;  // True poses of the rovers.
  std::vector<bool> is_outlier;   // One entry for each of graph.ranges.
};

Scenario MakeScenario(const ScenarioOptions& options);

// Root mean square distance to the truth over all rovers' nodes.
double TrajectoryErrorM(const Scenario& scenario, const std::map<NodeKey, Pose>& poses);

}  // namespace moondb::simulation
