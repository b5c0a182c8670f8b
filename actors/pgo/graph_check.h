// CheckGraph: what of a pose graph can be solved. The rest is named and left out.
//
// Records arrive in any order and from any agent, and one NaN makes Ceres refuse the whole solve: so an edge whose
// node is not here yet, a covariance that is not positive definite, a variance that is none of a sensor's (below 1e-12
// or above 1e8, in m^2 or rad^2), a range beyond 1e6 m or a number that is not finite costs that edge alone. Of records
// of one natural key (the node's key, the edge's ends) the smallest content stays, and the others are left out.
// Nodes come out sorted by key and edges by their ends, so that the same graph gives the same solution whatever the
// order in which it came. Pure functions; results point into `graph`, which must outlive them.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/pose_graph.h"

namespace moondb {

// What the team's configuration says of one agent.
struct AgentFacts {
  AgentId agent = 0;
  bool is_base_station = false;  // All its nodes stand fixed at `start`.
  // map_from_body at the beginning; none: not configured. Of a rover place and yaw count: its tilt is its raw pose's.
  std::optional<Pose> start;
  double start_sigma_m = 0.05;    // Of each coordinate of a rover's start, one sigma. 0 or less: the default.
  double start_sigma_rad = 0.01;  // Of each angle likewise.
  Eigen::Vector3d antenna_m = Eigen::Vector3d::Zero();  // Of the UWB radio, in the body's frame.
};

using AgentFactsMap = std::map<AgentId, AgentFacts>;

struct CheckedNode {
  NodeKey key;
  Pose raw;  // map_from_node; of a base station its configured pose.
  bool is_fixed = false;
};

// Ends are positions in CheckedGraph::nodes.
struct CheckedOdometry {
  std::size_t from = 0;
  std::size_t to = 0;
  const OdometryEdge* edge = nullptr;
  Pose from_from_to;  // The edge's, its quaternion of unit length.
};

struct CheckedRange {
  std::size_t from = 0;
  std::size_t to = 0;
  const RangeEdge* edge = nullptr;
};

using RangeKey = std::pair<NodeKey, NodeKey>;  // from, to

// An agent's nodes and edges that were not usable.
struct LeftOut {
  std::size_t count = 0;
  std::string first;  // Which one and why.
};

using LeftOutMap = std::map<AgentId, LeftOut>;  // By the agent of the node, or of the edge's `from`.

struct CheckedGraph {
  std::vector<CheckedNode> nodes;         // By key.
  std::vector<CheckedOdometry> odometry;  // By ends.
  std::vector<CheckedRange> ranges;       // By ends.
  LeftOutMap left_out;                    // What was not usable; empty when all was.

  std::optional<std::size_t> Find(const NodeKey& key) const;  // Its place in nodes.
};

// Base stations with a configured pose get their node {agent, 0} even where `graph` has none.
CheckedGraph CheckGraph(const PoseGraph& graph, const AgentFactsMap& agents);

// Consecutive in CheckedGraph::nodes: one rover's nodes, joined by its odometry.
struct Rover {
  AgentId agent = 0;
  std::size_t first = 0;  // Position of its first node.
  std::size_t count = 0;
  std::vector<std::size_t> part_heads;  // The first node of each part that odometry joins; one where it is unbroken.
};

// By agent; base stations are not among them.
std::vector<Rover> FindRovers(const CheckedGraph& graph);

inline constexpr double kApart_m = 1;  // Places nearer than this count as one.

// Fixed nodes hold a team's place; two apart from each other its yaw, too.
bool FixedNodesHoldYaw(const CheckedGraph& graph);

// "A7" is for files; people read "agent 2, node 7".
std::string ToString(const NodeKey& key);

}  // namespace moondb
