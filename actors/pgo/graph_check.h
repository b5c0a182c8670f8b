// CheckGraph: returns the usable nodes, edges and priors of a pose graph, and names those that it leaves out.
//
// Records arrive in any order and from any agent, and one NaN makes Ceres refuse the whole solve. CheckGraph therefore
// leaves out each unusable node or edge. An edge is unusable, for example, for one of these reasons:
// - one of its nodes has not arrived;
// - its covariance is not positive definite;
// - its variance is below 1e-12 or above 1e8, in m^2 or rad^2;
// - its range exceeds 1e6 m;
// - one of its numbers is not finite;
// - it is a loop closure to a base station, which has a position but no heading.
//
// Among records with the same natural key (the node's key, the edge's ends, or the FactorKey), the first one in a fixed
// order of the contents is kept. The result therefore does not depend on the order of arrival. Results point into
// `graph`, which must outlive them.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "model/pose_graph.h"

namespace moondb {

// Configuration of one agent that the solver needs.
struct AgentFacts {
  AgentId agent = 0;
  bool is_base_station = false;  // All nodes of a base station are fixed at `start`.
  // map_from_body at the first node; nullopt if not configured. For a rover only position and yaw are used, because its
  // roll and pitch come from its raw pose.
  std::optional<Pose> start;
  // Standard deviation of each coordinate of a rover's start. 0 or less: use the default.
  double start_sigma_m = 0.05;
  double start_sigma_rad = 0.01;  // Standard deviation of each angle of a rover's start. 0 or less: use the default.
  Eigen::Vector3d antenna_m = Eigen::Vector3d::Zero();  // Position of the UWB antenna in the body's frame.
  bool has_fixed_scale = false;                         // True if the odometry scale is 1 and not estimated.
  std::uint64_t start_index = 0;                        // Number of the node at which the rover is at `start`.
};

using AgentFactsMap = std::map<AgentId, AgentFacts>;

struct CheckedNode {
  NodeKey key;
  Pose raw;  // map_from_node as recorded, or the configured pose of a base station.
  bool is_fixed = false;
};

// `from` and `to` are indices in CheckedGraph::nodes.
struct CheckedOdometry {
  std::size_t from = 0;
  std::size_t to = 0;
  const OdometryEdge* edge = nullptr;
  Pose from_from_to;  // The edge's relative pose with a normalised quaternion.
};

struct CheckedRange {
  std::size_t from = 0;
  std::size_t to = 0;
  const RangeEdge* edge = nullptr;
};

struct CheckedClosure {
  std::size_t from = 0;
  std::size_t to = 0;
  const LoopClosure* edge = nullptr;
  Pose from_from_to;  // The edge's relative pose with a normalised quaternion.
};

struct CheckedPrior {
  std::size_t node = 0;
  const NodePrior* prior = nullptr;
};

// Unusable nodes, edges and priors of one agent.
struct LeftOut {
  std::size_t count = 0;
  std::string first;  // Name of the first unusable node or edge, and the reason.
};

using LeftOutMap = std::map<AgentId, LeftOut>;  // Keyed by the agent of the node, or of the edge's `from` node.

// The tested factors of a graph are the measurements that a solve may reject. They are numbered: first the ranges, then
// the loop closures, then the priors.
struct CheckedGraph {
  std::vector<CheckedNode> nodes;         // Nodes sorted by key.
  std::vector<CheckedOdometry> odometry;  // Steps sorted by their ends.
  std::vector<CheckedRange> ranges;       // Ranges sorted by their ends.
  std::vector<CheckedClosure> closures;   // Loop closures sorted by their ends and source.
  std::vector<CheckedPrior> priors;       // Priors sorted by their node and source.
  std::set<AgentId> fixed_scales;         // Agents whose odometry scale is 1 and not estimated.
  LeftOutMap left_out;                    // Unusable nodes, edges and priors. Empty if all were usable.

  std::optional<std::size_t> Find(const NodeKey& key) const;  // Returns the node's index in `nodes`; nullopt if absent.

  std::size_t tested_count() const { return ranges.size() + closures.size() + priors.size(); }
  std::size_t first_closure() const { return ranges.size(); }  // Number of the first loop closure.
  std::size_t first_prior() const { return ranges.size() + closures.size(); }
  // Returns the key of a tested factor.
  FactorKey KeyOfTested(std::size_t factor) const;
  // Returns the agent that inserted a tested factor; 0 if unknown.
  AgentId ProducerOfTested(std::size_t factor) const;
  // Returns the indices in `nodes` of a tested factor's ends. Both are equal for a prior.
  std::pair<std::size_t, std::size_t> EndsOfTested(std::size_t factor) const;
};

// Checks `graph` and returns its usable part. A base station with a configured pose gets a node {agent, 0} if `graph`
// has no usable node with this key.
CheckedGraph CheckGraph(const PoseGraph& graph, const AgentFactsMap& agents);

// One rover's nodes, which are contiguous in CheckedGraph::nodes.
struct Rover {
  AgentId agent = 0;
  std::size_t first = 0;  // Index of the rover's first node.
  std::size_t count = 0;
  // The first node of each part connected by odometry. One element if the odometry is unbroken.
  std::vector<std::size_t> part_heads;
};

// Returns the rovers, sorted by agent. Base stations are not included.
std::vector<Rover> FindRovers(const CheckedGraph& graph);

inline constexpr double kApart_m = 1;  // Positions closer than this count as the same place.

// Returns true if fixed nodes determine the team's yaw: two fixed nodes are more than kApart_m apart horizontally. A
// single fixed node determines only the position.
bool FixedNodesHoldYaw(const CheckedGraph& graph);

// Returns for example "agent 2, node 7".
std::string ToString(const NodeKey& key);

}  // namespace moondb
