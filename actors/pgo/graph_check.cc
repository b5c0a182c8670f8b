#include "actors/pgo/graph_check.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <tuple>
#include <unordered_map>

#include "actors/pgo/connected_parts.h"

namespace moondb {

namespace {

void LeaveOut(CheckedGraph& checked, AgentId agent, const std::string& what, const std::string& why) {
  LeftOut& left_out = checked.left_out[agent];
  if (left_out.count++ == 0) left_out.first = what + ": " + why;
}

std::string EdgeName(const char* kind, const NodeKey& from, const NodeKey& to) {
  return std::string(kind) + " from " + ToString(from) + " to " + ToString(to);
}

bool IsUsable(const Pose& pose) {
  const double length = pose.orientation.norm();
  return pose.position_m.allFinite() && std::isfinite(length) && length > 0.5 && length < 2;
}

bool IsPositiveDefinite(const Matrix6d& matrix) {
  if (!matrix.allFinite()) return false;
  if ((matrix - matrix.transpose()).cwiseAbs().maxCoeff() > 1e-9 * matrix.cwiseAbs().maxCoeff()) return false;
  const Eigen::LLT<Matrix6d> factorised(matrix);
  return factorised.info() == Eigen::Success && factorised.matrixLLT().diagonal().minCoeff() > 0;
}

const AgentFacts* FactsOf(const AgentFactsMap& agents, AgentId agent) {
  const auto found = agents.find(agent);
  return found == agents.end() ? nullptr : &found->second;
}

CheckedNode ToChecked(const NodeKey& key, Pose raw, const AgentFactsMap& agents) {
  const AgentFacts* facts = FactsOf(agents, key.agent);
  const bool is_fixed = facts != nullptr && facts->is_base_station;
  if (is_fixed && facts->start) raw = *facts->start;
  raw.orientation.normalize();
  return CheckedNode{key, raw, is_fixed};
}

void CheckNodes(const PoseGraph& graph, const AgentFactsMap& agents, CheckedGraph& checked) {
  for (const GraphNode& node : graph.nodes) {
    if (!IsUsable(node.map_from_node)) {
      LeaveOut(checked, node.key.agent, ToString(node.key), "its pose is not finite or not a rotation");
      continue;
    }
    checked.nodes.push_back(ToChecked(node.key, node.map_from_node, agents));
  }
  for (const auto& [agent, facts] : agents) {
    if (facts.is_base_station && facts.start)
      checked.nodes.push_back(ToChecked(NodeKey{agent, 0}, *facts.start, agents));
  }
  const auto by_key = [](const CheckedNode& a, const CheckedNode& b) { return a.key < b.key; };
  const auto same_key = [](const CheckedNode& a, const CheckedNode& b) { return a.key == b.key; };
  std::stable_sort(checked.nodes.begin(), checked.nodes.end(), by_key);
  checked.nodes.erase(std::unique(checked.nodes.begin(), checked.nodes.end(), same_key), checked.nodes.end());
}

// Empty where the edge can be used.
std::string WhyNot(const OdometryEdge& edge) {
  if (edge.from.agent != edge.to.agent) return "joins two agents";
  if (edge.from == edge.to) return "joins a node with itself";
  if (!IsUsable(edge.from_from_to)) return "its pose is not finite or not a rotation";
  if (!IsPositiveDefinite(edge.covariance)) return "its covariance is not symmetric and positive definite";
  return {};
}

std::string WhyNot(const RangeEdge& edge) {
  if (edge.from.agent == edge.to.agent) return "is within one agent";
  if (!std::isfinite(edge.range_m) || edge.range_m < 0) return "is not a distance";
  if (!std::isfinite(edge.variance_m2) || edge.variance_m2 <= 0) return "its variance is not positive";
  return {};
}

template <typename CheckedEdge, typename Edge>
void CheckEdges(const std::vector<Edge>& edges, const char* kind, CheckedGraph& checked,
                std::vector<CheckedEdge>& out) {
  for (const Edge& edge : edges) {
    std::string why = WhyNot(edge);
    const std::optional<std::size_t> from = checked.Find(edge.from);
    const std::optional<std::size_t> to = checked.Find(edge.to);
    if (why.empty() && !from) why = ToString(edge.from) + " is not known here";
    if (why.empty() && !to) why = ToString(edge.to) + " is not known here";
    if (why.empty() && checked.nodes[*from].is_fixed && checked.nodes[*to].is_fixed) why = "both ends stand fixed";
    if (!why.empty()) {
      LeaveOut(checked, edge.from.agent, EdgeName(kind, edge.from, edge.to), why);
      continue;
    }
    out.push_back(CheckedEdge{*from, *to, &edge});
  }
  std::stable_sort(out.begin(), out.end(), [](const CheckedEdge& a, const CheckedEdge& b) {
    return std::tuple(a.from, a.to, a.edge->stamp_ns) < std::tuple(b.from, b.to, b.edge->stamp_ns);
  });
}

// The smallest node that odometry joins each node with, directly or over others.
std::vector<std::size_t> FindHeads(const CheckedGraph& graph) {
  ConnectedParts parts(graph.nodes.size());
  for (const CheckedOdometry& edge : graph.odometry) parts.Join(edge.from, edge.to);
  std::vector<std::size_t> heads(graph.nodes.size());
  for (std::size_t node = 0; node < heads.size(); ++node) heads[node] = parts.HeadOf(node);
  return heads;
}

}  // namespace

std::optional<std::size_t> CheckedGraph::Find(const NodeKey& key) const {
  const auto found = std::lower_bound(nodes.begin(), nodes.end(), key,
                                      [](const CheckedNode& node, const NodeKey& k) { return node.key < k; });
  if (found == nodes.end() || found->key != key) return std::nullopt;
  return static_cast<std::size_t>(found - nodes.begin());
}

std::string ToString(const NodeKey& key) {
  return "agent " + std::to_string(key.agent) + ", node " + std::to_string(key.index);
}

CheckedGraph CheckGraph(const PoseGraph& graph, const AgentFactsMap& agents) {
  CheckedGraph checked;
  CheckNodes(graph, agents, checked);
  CheckEdges(graph.odometry, "odometry", checked, checked.odometry);
  CheckEdges(graph.ranges, "range", checked, checked.ranges);
  return checked;
}

std::vector<Rover> FindRovers(const CheckedGraph& graph) {
  const std::vector<std::size_t> heads = FindHeads(graph);
  std::vector<Rover> rovers;
  for (std::size_t node = 0; node < graph.nodes.size(); ++node) {
    if (graph.nodes[node].is_fixed) continue;
    const AgentId agent = graph.nodes[node].key.agent;
    if (rovers.empty() || rovers.back().agent != agent) rovers.push_back(Rover{agent, node, 0, {}});
    ++rovers.back().count;
    if (heads[node] == node) rovers.back().part_heads.push_back(node);
  }
  return rovers;
}

}  // namespace moondb
