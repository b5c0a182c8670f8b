// Where a solve begins: the last solution, and what it does not hold yet by odometry from there.
#pragma once

#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "actors/pgo/graph_check.h"

namespace moondb {

// A number for each pair of agents, the smaller id first.
using PairNumbers = std::map<std::pair<AgentId, AgentId>, double>;

struct InitialValues {
  std::vector<Pose> poses;      // map_from_node of each of CheckedGraph::nodes.
  std::vector<double> scales;   // s of each rover; true length is (1 + s) times odometry's.
  std::vector<bool> is_warm;    // Of each node: the last solution gave it.
  bool has_warm = false;        // Any of them;
  bool is_mostly_warm = false;  // at least 80 % of those that do not stand fixed.
  PairNumbers biases_m;         // Of pairs of agents; missing: 0.
};

// The pose that a rover's first node is held to.
struct StartPrior {
  Pose map_from_node;
  double sigma_m = 0;
  double sigma_rad = 0;
  bool is_configured = false;  // False: the raw pose, because the configured start is missing or of another node.
};

struct LoosePrior {
  double sigma_m = 10;  // What is known of a part whose place in the map nobody has given.
  double sigma_rad = 1;
};

// The configured start counts for a rover's node 0, and for a first node of another number whose raw pose agrees with
// it; a first node further on (its predecessors have not come yet) is held loosely to its raw pose.
StartPrior FindStartPrior(const CheckedNode& first, const AgentFactsMap& agents, const LoosePrior& loose);

// The last solution where it has a node; else its neighbour's pose and the odometry between, stretched by the scale
// that the last solution shows; across a gap in the odometry the raw poses' difference; for the first node the start.
InitialValues FindInitialValues(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                const std::vector<StartPrior>& starts, const std::map<NodeKey, Pose>& last_solution);

// Each pair's constant range error as `poses` show it: its maximum of probability over the ranges in `counts`, of sigma
// bias_sigma_m about 0.
PairNumbers EstimateBiases(const CheckedGraph& graph, const AgentFactsMap& agents, const std::vector<Pose>& poses,
                           const std::vector<bool>& counts, double bias_sigma_m);

// Whether the last solution or the configuration says where a node is.
bool IsKnown(const CheckedGraph& graph, const InitialValues& initial, std::size_t node);

// Of the agent's radio in its body's frame; zero where nothing is configured.
Eigen::Vector3d AntennaOf(const AgentFactsMap& agents, AgentId agent);

}  // namespace moondb
