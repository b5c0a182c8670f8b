// Initial values of a solve: poses from the last solution, extended to new nodes by odometry.
#pragma once

#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "actors/pgo/graph_check.h"

namespace moondb {

// A number for each pair of agents. The key holds the smaller id first.
using PairNumbers = std::map<std::pair<AgentId, AgentId>, double>;

struct InitialValues {
  std::vector<Pose> poses;  // map_from_node, in the order of CheckedGraph::nodes.
  // Odometry scale error s of each rover: true length is (1 + s) times the length in odometry.
  std::vector<double> scales;
  std::vector<bool> is_warm;    // True for nodes whose pose is from the last solution.
  bool has_warm = false;        // True if at least one node is warm.
  bool is_mostly_warm = false;  // True if at least 80 % of the nodes that are not fixed are warm.
  PairNumbers biases_m;         // Range bias by pair of agents. A missing pair means 0.
};

// Prior on the pose of a rover's first node.
struct StartPrior {
  Pose map_from_node;
  double sigma_m = 0;
  double sigma_rad = 0;
  // True if the prior is the configured start. False if the prior is the raw pose: no start is configured, or the
  // configured start belongs to another node.
  bool is_configured = false;
};

struct LoosePrior {
  double sigma_m = 10;  // Standard deviation of each coordinate if no start is configured.
  double sigma_rad = 1;
};

// Returns the configured start, if there is one and `first` is node 0 or has a raw pose close to the start. Otherwise
// returns the raw pose of `first`, with the sigmas of `loose`.
StartPrior FindStartPrior(const CheckedNode& first, const AgentFactsMap& agents, const LoosePrior& loose);

// Chooses each node's pose from the first available source:
// 1. the last solution;
// 2. a neighbouring node's pose composed with odometry, corrected by the rover's scale error in the last solution;
// 3. across a gap in the odometry, the pose of another node of the rover composed with the difference of the raw poses;
// 4. the rover's start prior (`starts`), if no node of the rover has a pose yet.
InitialValues FindInitialValues(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                const std::vector<StartPrior>& starts, const std::map<NodeKey, Pose>& last_solution);

// Returns the constant range error of each pair of agents at `poses`: the maximum a posteriori estimate over the ranges
// whose flag in `counts` is true, with a zero-mean prior with standard deviation bias_sigma_m.
PairNumbers EstimateBiases(const CheckedGraph& graph, const AgentFactsMap& agents, const std::vector<Pose>& poses,
                           const std::vector<bool>& counts, double bias_sigma_m);

// Returns true if the node's pose comes from the last solution or from the configuration.
bool IsKnown(const CheckedGraph& graph, const InitialValues& initial, std::size_t node);

// Returns the position of the agent's UWB antenna in the agent's body frame; zero if not configured.
Eigen::Vector3d AntennaOf(const AgentFactsMap& agents, AgentId agent);

}  // namespace moondb
