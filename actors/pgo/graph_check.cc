#include "actors/pgo/graph_check.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <tuple>
#include <utility>

#include "actors/pgo/connected_parts.h"

namespace moondb {

namespace {

constexpr const char* kVarianceText = "between 1e-12 and 1e8";
constexpr const char* kDoubled = "occurs more than once";

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

// Returns the reason if the covariance is unusable; an empty string if it is usable.
std::string WhyNot(const Matrix6d& covariance) {
  const double largest = covariance.cwiseAbs().maxCoeff();
  const bool is_symmetric =
      covariance.allFinite() && (covariance - covariance.transpose()).cwiseAbs().maxCoeff() <= 1e-9 * largest;
  const Eigen::LLT<Matrix6d> factorised(covariance);
  if (!is_symmetric || factorised.info() != Eigen::Success || factorised.matrixLLT().diagonal().minCoeff() <= 0) {
    return "its covariance is not symmetric and positive definite";
  }
  // The squared diagonal of the Cholesky factor holds each variance conditioned on the preceding variables. The
  // covariance's own diagonal would not show that the matrix is nearly singular.
  const double smallest = factorised.matrixLLT().diagonal().cwiseAbs2().minCoeff();
  const bool is_usable = smallest >= kVarianceMin && covariance.diagonal().maxCoeff() <= kVarianceMax;
  return is_usable ? "" : std::string("its variances are not ") + kVarianceText;
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

// Sort key of a node (its key, then its pose) or of an edge (its ends, then its time and measurement).
std::pair<NodeKey, std::array<double, 7>> OrderOf(const CheckedNode& node) {
  std::array<double, 7> content{};
  Eigen::Map<Eigen::Vector3d>(content.data()) = node.raw.position_m;
  Eigen::Map<Eigen::Vector4d>(content.data() + 3) = node.raw.orientation.coeffs();
  return {node.key, content};
}

NodeKey NameOf(const CheckedNode& node) { return node.key; }

template <typename CheckedEdge>
std::pair<std::size_t, std::size_t> NameOf(const CheckedEdge& edge) {
  return {edge.from, edge.to};
}

FactorKey NameOf(const CheckedClosure& closure) { return KeyOf(*closure.edge); }
FactorKey NameOf(const CheckedPrior& prior) { return KeyOf(*prior.prior); }

auto OrderOf(const CheckedRange& range) {
  return std::tuple(range.from, range.to, range.edge->timestamp_ns, range.edge->range_m, range.edge->variance_m2);
}

std::array<double, 13> ContentOf(const Pose& pose, const Matrix6d& covariance) {
  std::array<double, 13> content{};
  Eigen::Map<Eigen::Vector3d>(content.data()) = pose.position_m;
  Eigen::Map<Eigen::Vector4d>(content.data() + 3) = pose.orientation.coeffs();
  Eigen::Map<Eigen::Matrix<double, 6, 1>>(content.data() + 7) = covariance.diagonal();
  return content;
}

auto OrderOf(const CheckedOdometry& odometry) {
  const OdometryEdge& edge = *odometry.edge;
  return std::tuple(odometry.from, odometry.to, edge.timestamp_ns, ContentOf(edge.from_from_to, edge.covariance));
}

auto OrderOf(const CheckedClosure& closure) {
  const LoopClosure& edge = *closure.edge;
  return std::tuple(closure.from, closure.to, std::string_view(edge.source), edge.timestamp_ns,
                    ContentOf(edge.from_from_to, edge.covariance));
}

auto OrderOf(const CheckedPrior& checked) {
  const NodePrior& prior = *checked.prior;
  return std::tuple(checked.node, std::string_view(prior.source), prior.timestamp_ns, prior.extent,
                    ContentOf(prior.map_from_node, prior.covariance));
}

template <typename Item, typename Report>
void SortAndLeaveOutDoubled(std::vector<Item>& items, const Report& report) {
  std::stable_sort(items.begin(), items.end(), [](const Item& a, const Item& b) { return OrderOf(a) < OrderOf(b); });
  std::vector<Item> kept;
  kept.reserve(items.size());
  for (Item& item : items) {
    if (!kept.empty() && NameOf(kept.back()) == NameOf(item)) {
      report(item);
    } else {
      kept.push_back(std::move(item));
    }
  }
  items = std::move(kept);
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
    const NodeKey key{agent, 0};
    const auto is_same = [&key](const CheckedNode& node) { return node.key == key; };
    if (!facts.is_base_station || !facts.start) continue;
    if (std::any_of(checked.nodes.begin(), checked.nodes.end(), is_same)) continue;
    checked.nodes.push_back(ToChecked(key, *facts.start, agents));
  }
  SortAndLeaveOutDoubled(checked.nodes, [&checked](const CheckedNode& node) {
    LeaveOut(checked, node.key.agent, ToString(node.key), kDoubled);
  });
}

// Returns the reason if the edge is unusable; an empty string if it is usable.
std::string WhyNot(const OdometryEdge& edge) {
  if (edge.from.agent != edge.to.agent) return "joins two agents";
  if (edge.from == edge.to) return "joins a node with itself";
  if (!IsUsable(edge.from_from_to)) return "its pose is not finite or not a rotation";
  return WhyNot(edge.covariance);
}

std::string WhyNot(const LoopClosure& edge) {
  if (edge.from == edge.to) return "joins a node with itself";
  if (!IsUsable(edge.from_from_to)) return "its pose is not finite or not a rotation";
  return WhyNot(edge.covariance);
}

std::string WhyNot(const NodePrior& prior) {
  if (!IsUsable(prior.map_from_node)) return "its pose is not finite or not a rotation";
  if (!prior.point_m.allFinite()) return "its point is not finite";
  return WhyNot(prior.covariance);
}

std::string WhyNot(const RangeEdge& edge) {
  if (edge.from.agent == edge.to.agent) return "joins two nodes of one agent";
  const bool is_distance = edge.range_m >= 0 && edge.range_m <= kRangeMax_m;  // False for NaN.
  if (!is_distance) return "is not a distance below 1e6 m";
  const bool is_variance = edge.variance_m2 >= kVarianceMin && edge.variance_m2 <= kVarianceMax;
  return is_variance ? "" : std::string("its variance is not ") + kVarianceText;
}

CheckedOdometry ToChecked(std::size_t from, std::size_t to, const OdometryEdge& edge) {
  return {from, to, &edge, Pose{edge.from_from_to.position_m, edge.from_from_to.orientation.normalized()}};
}

CheckedRange ToChecked(std::size_t from, std::size_t to, const RangeEdge& edge) { return {from, to, &edge}; }

CheckedClosure ToChecked(std::size_t from, std::size_t to, const LoopClosure& edge) {
  return {from, to, &edge, Pose{edge.from_from_to.position_m, edge.from_from_to.orientation.normalized()}};
}

template <typename CheckedEdge, typename Edge>
void CheckEdges(const std::vector<Edge>& edges, const char* kind, CheckedGraph& checked,
                std::vector<CheckedEdge>& out) {
  for (const Edge& edge : edges) {
    std::string why = WhyNot(edge);
    const std::optional<std::size_t> from = checked.Find(edge.from);
    const std::optional<std::size_t> to = checked.Find(edge.to);
    if (why.empty() && !from) why = ToString(edge.from) + " has no node record";
    if (why.empty() && !to) why = ToString(edge.to) + " has no node record";
    if (why.empty() && checked.nodes[*from].is_fixed && checked.nodes[*to].is_fixed) why = "both nodes are fixed";
    if (!why.empty()) {
      LeaveOut(checked, edge.from.agent, EdgeName(kind, edge.from, edge.to), why);
      continue;
    }
    out.push_back(ToChecked(*from, *to, edge));
  }
  SortAndLeaveOutDoubled(out, [&](const CheckedEdge& edge) {
    LeaveOut(checked, edge.edge->from.agent, EdgeName(kind, edge.edge->from, edge.edge->to), kDoubled);
  });
}

// Removes loop closures that end at a base station.
void LeaveOutClosuresToBaseStations(CheckedGraph& checked) {
  std::erase_if(checked.closures, [&checked](const CheckedClosure& closure) {
    if (!checked.nodes[closure.from].is_fixed && !checked.nodes[closure.to].is_fixed) return false;
    const LoopClosure& edge = *closure.edge;
    LeaveOut(checked, edge.from.agent, EdgeName("loop closure", edge.from, edge.to),
             "a base station has no heading; insert a pose prior instead");
    return true;
  });
}

void CheckPriors(const std::vector<NodePrior>& priors, CheckedGraph& checked) {
  const auto name_of = [](const NodePrior& prior) { return "prior of " + ToString(prior.node); };
  for (const NodePrior& prior : priors) {
    std::string why = WhyNot(prior);
    const std::optional<std::size_t> node = checked.Find(prior.node);
    if (why.empty() && !node) why = "its node is not among the stored nodes";
    if (why.empty() && checked.nodes[*node].is_fixed) why = "the node is fixed";
    if (why.empty()) {
      checked.priors.push_back({*node, &prior});
    } else {
      LeaveOut(checked, prior.node.agent, name_of(prior), why);
    }
  }
  SortAndLeaveOutDoubled(checked.priors, [&](const CheckedPrior& prior) {
    LeaveOut(checked, prior.prior->node.agent, name_of(*prior.prior), kDoubled);
  });
}

// Removes odometry edges that skip intermediate nodes. A wrong edge of this kind, for example a loop closure stored as
// odometry, can shrink the whole trajectory. Agents refuse to insert such an edge, but a store may still hold one.
void LeaveOutWhatSkipsNodes(CheckedGraph& checked) {
  std::erase_if(checked.odometry, [&checked](const CheckedOdometry& odometry) {
    const auto [first, last] = std::minmax(odometry.from, odometry.to);
    if (last - first == 1) return false;
    const OdometryEdge& edge = *odometry.edge;
    LeaveOut(checked, edge.from.agent, EdgeName("odometry", edge.from, edge.to),
             "skips " + ToString(checked.nodes[first + 1].key));
    return true;
  });
}

// Returns, for each node, the lowest index of a node connected to it by odometry.
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

FactorKey CheckedGraph::KeyOfTested(std::size_t factor) const {
  if (factor < first_closure()) return KeyOf(*ranges[factor].edge);
  if (factor < first_prior()) return KeyOf(*closures[factor - first_closure()].edge);
  return KeyOf(*priors[factor - first_prior()].prior);
}

AgentId CheckedGraph::ProducerOfTested(std::size_t factor) const {
  if (factor < first_closure()) return ranges[factor].edge->producer;
  if (factor < first_prior()) return closures[factor - first_closure()].edge->producer;
  return priors[factor - first_prior()].prior->producer;
}

std::pair<std::size_t, std::size_t> CheckedGraph::EndsOfTested(std::size_t factor) const {
  if (factor < first_closure()) return {ranges[factor].from, ranges[factor].to};
  if (factor < first_prior()) {
    const CheckedClosure& closure = closures[factor - first_closure()];
    return {closure.from, closure.to};
  }
  const std::size_t node = priors[factor - first_prior()].node;
  return {node, node};
}

std::string ToString(const NodeKey& key) {
  return "agent " + std::to_string(key.agent) + ", node " + std::to_string(key.index);
}

CheckedGraph CheckGraph(const PoseGraph& graph, const AgentFactsMap& agents) {
  CheckedGraph checked;
  for (const auto& [agent, facts] : agents) {
    if (facts.has_fixed_scale) checked.fixed_scales.insert(agent);
  }
  CheckNodes(graph, agents, checked);
  CheckEdges(graph.odometry, "odometry", checked, checked.odometry);
  LeaveOutWhatSkipsNodes(checked);
  CheckEdges(graph.ranges, "range", checked, checked.ranges);
  CheckEdges(graph.closures, "loop closure", checked, checked.closures);
  LeaveOutClosuresToBaseStations(checked);
  CheckPriors(graph.priors, checked);
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

bool FixedNodesHoldYaw(const CheckedGraph& graph) {
  const CheckedNode* first = nullptr;
  for (const CheckedNode& node : graph.nodes) {
    if (!node.is_fixed) continue;
    if (first == nullptr) first = &node;
    if ((node.raw.position_m - first->raw.position_m).head<2>().norm() > kApart_m) return true;
  }
  return false;
}

}  // namespace moondb
