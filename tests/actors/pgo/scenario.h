// Scenario: a small team that drives over hills, drawn from a seed. What the solver is tested against.
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
  int node_count = 100;  // Of each rover.
  double step_m = 1;
  int range_every = 4;  // Nodes.
  double range_sigma_m = 0.10;
  double outlier_ratio = 0;  // Too long by outlier_min_m to outlier_max_m.
  double outlier_min_m = 1;
  double outlier_max_m = 5;
  double correlation = 0;                 // Of the noise of a pair's consecutive ranges; its sigma stays range_sigma_m.
  std::vector<double> scale_errors = {};  // s of each rover; missing: 0.
  double step_noise_m = 0.02;             // Per step in x and y, half of it in z.
  double yaw_noise_rad = 0.004;           // Per step.
  double tilt_noise_rad = 0.002;          // Per step, in the odometry; raw poses' tilt follows gravity within 0.01.
  double bias_sigma_m = 0;                // Of each pair.
  Eigen::Vector3d antenna_m = Eigen::Vector3d(0.3, 0.2, 0.5);
  bool has_base_station = true;
  double start_sigma_m = 0.05;  // Of the start poses that rovers are told.
  double start_sigma_rad = 0.01;
  // Each rover circles in a sector of its own about the base station; else all start in one line and drive wide arcs,
  // so that what turns the whole team about the base station is known from the starts alone.
  bool is_around_base = false;
};

struct Scenario {
  PoseGraph graph;
  AgentFactsMap agents;
  std::map<NodeKey, Pose> truth;  // Of the rovers.
  std::vector<bool> is_outlier;   // One for each of graph.ranges.
};

Scenario MakeScenario(const ScenarioOptions& options);

// Root of the mean squared distance to the truth, over all rovers' nodes.
double TrajectoryErrorM(const Scenario& scenario, const std::map<NodeKey, Pose>& poses);

}  // namespace moondb::simulation
