#include "actors/pgo/known_graph.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <functional>
#include <iterator>
#include <optional>

#include "model/pose_carrier.h"

namespace moondb {

namespace {

// No sensor of a rover measures its distance or pose from another rover better, and a smaller sigma would let one
// measurement outweigh all others.
constexpr double kRangeSigmaMin_m = 0.05;
constexpr double kClosureSigmaMin_m = 0.02;
constexpr double kClosureSigmaMin_rad = 0.002;

// Raises the variances of the translation and of the rotation so that none, in any direction, is below its minimum.
void RaiseVariances(Matrix6d& covariance, double sigma_min_m, double sigma_min_rad) {
  const auto raise = [](auto block, double sigma_min) {
    const double smallest =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(block, Eigen::EigenvaluesOnly).eigenvalues()(0);
    const double missing = sigma_min * sigma_min - smallest;
    if (missing > 0) block.diagonal().array() += missing;
  };
  raise(covariance.topLeftCorner<3, 3>(), sigma_min_m);
  raise(covariance.bottomRightCorner<3, 3>(), sigma_min_rad);
}

// Calls take(record key, node or edge) for the first record of each node or edge. Only the first record is valid.
template <typename Records, typename Take>
void ForEachStanding(const Records& records, const Take& take) {
  for (auto record = records.begin(); record != records.end(); ++record) {
    const bool is_first = record == records.begin() || std::prev(record)->first.first != record->first.first;
    if (is_first) take(record->first.second, record->second);
  }
}

}  // namespace

KnownGraph::KnownGraph(const Limits& limits)
    : limits_(limits),
      node_quota_(limits.nodes_max, limits.nodes_max / limits.agent_count),
      edge_quota_(limits.edges_max, limits.edges_max / limits.agent_count) {}

Result<void> KnownGraph::Add(const RecordKey& key, const proto::Record& record) {
  if (record.has_optimized_pose()) return AddPose(key, record.optimized_pose());
  if (record.has_edge_verdict()) {
    AddVerdict(key, record.edge_verdict());
    return {};
  }
  if (record.has_map_match()) return AddMatch(key, record);
  if (record.has_map_quarantine()) {
    quarantines_.Add(key, record.map_quarantine());
    return {};
  }
  PoseGraph one;
  if (auto added = AddRecord(record, one); !added) return added;
  for (const GraphNode& node : one.nodes) {
    if (!nodes_.emplace(std::pair(node.key, key), node).second) continue;
    for (const auto& removed : node_quota_.Add(key, 1, node.key)) nodes_.erase({removed.note, removed.key});
  }
  for (const OdometryEdge& edge : one.odometry) {
    const EdgeName name{edge.from, edge.to};
    if (!odometry_.emplace(std::pair(name, key), edge).second) continue;
    AddEdge(key, {{FactorKind::kRange, edge.from, edge.to, {}}, /*is_odometry=*/true});
  }
  for (RangeEdge& edge : one.ranges) {
    edge.producer = key.stream.origin;
    if (ranges_.emplace(std::pair(EdgeName{edge.from, edge.to}, key), edge).second) AddEdge(key, {KeyOf(edge)});
  }
  for (LoopClosure& closure : one.closures) {
    closure.producer = key.stream.origin;
    if (closures_.emplace(std::pair(KeyOf(closure), key), closure).second) AddEdge(key, {KeyOf(closure)});
  }
  for (NodePrior& prior : one.priors) {
    prior.producer = key.stream.origin;
    if (priors_.emplace(std::pair(KeyOf(prior), key), prior).second) AddEdge(key, {KeyOf(prior)});
  }
  return {};
}

void KnownGraph::AddEdge(const RecordKey& key, const EdgeNote& note) {
  for (const auto& removed : edge_quota_.Add(key, 1, note)) {
    const FactorKey& name = removed.note.key;
    if (removed.note.is_odometry) {
      odometry_.erase({EdgeName{name.from, name.to}, removed.key});
    } else if (name.kind == FactorKind::kRange) {
      ranges_.erase({EdgeName{name.from, name.to}, removed.key});
    } else if (name.kind == FactorKind::kLoopClosure) {
      closures_.erase({name, removed.key});
    } else {
      priors_.erase({name, removed.key});
    }
  }
}

SolveSize KnownGraph::SolveSizeMax(std::size_t node_count) {
  return {30'000 + 16 * node_count, 5'000'000 + 1000 * node_count};
}

KnownGraph::Selection KnownGraph::SelectForSolve(const SolveSize& size) const {
  Selection selection = Select(size, /*has_all_nodes=*/false);
  // Older stores hold variances that a client may not insert any more (model/insert_check.h). They are used.
  for (OdometryEdge& edge : selection.graph.odometry) LimitVariances(edge.covariance);
  for (NodePrior& prior : selection.graph.priors) LimitVariances(prior.covariance);
  for (RangeEdge& edge : selection.graph.ranges) {
    edge.variance_m2 = std::clamp(edge.variance_m2, kRangeSigmaMin_m * kRangeSigmaMin_m, kVarianceMax);
  }
  for (LoopClosure& closure : selection.graph.closures) {
    LimitVariances(closure.covariance);
    RaiseVariances(closure.covariance, kClosureSigmaMin_m, kClosureSigmaMin_rad);
  }
  return selection;
}

KnownGraph::Selection KnownGraph::Select(const SolveSize& size, bool has_all_nodes) const {
  struct Extra {
    RecordKey key;
    std::pair<int, int> joined;
    const OdometryEdge* odometry = nullptr;
    const RangeEdge* range = nullptr;
    const LoopClosure* closure = nullptr;
  };
  Selection selection;
  std::map<NodeKey, int> place_of;
  selection.graph.nodes = SelectNodes(has_all_nodes ? nullptr : &selection.left_out);
  for (const GraphNode& node : selection.graph.nodes) place_of.emplace(node.key, static_cast<int>(place_of.size()));
  std::vector<std::pair<int, int>> chain;
  std::map<AgentId, std::vector<Extra>> extras;
  const auto places = [&place_of](const auto& edge) -> std::optional<std::pair<int, int>> {
    const auto from = place_of.find(edge.from);
    const auto to = place_of.find(edge.to);
    if (from == place_of.end() || to == place_of.end()) return std::nullopt;
    return std::pair(from->second, to->second);
  };
  ForEachStanding(odometry_, [&](const RecordKey& key, const OdometryEdge& edge) {
    const auto joined = places(edge);
    const bool is_step = !joined || (edge.from.agent == edge.to.agent && joined->first + 1 == joined->second);
    if (!is_step) return extras[key.stream.origin].push_back({.key = key, .joined = *joined, .odometry = &edge});
    if (joined) chain.push_back(*joined);
    // The edge is kept even if one of its nodes is missing. The solver then reports the edge as left out.
    selection.graph.odometry.push_back(edge);
  });
  ForEachStanding(ranges_, [&](const RecordKey& key, const RangeEdge& edge) {
    if (quarantines_.HasFactor(key, KeyOf(edge))) return;
    const auto joined = places(edge);
    if (!joined) return selection.graph.ranges.push_back(edge);
    extras[key.stream.origin].push_back({.key = key, .joined = *joined, .range = &edge});
  });
  const auto select_closure = [&](const RecordKey& key, const LoopClosure& closure) {
    const auto joined = places(closure);
    if (!joined) return selection.graph.closures.push_back(closure);
    extras[key.stream.origin].push_back({.key = key, .joined = *joined, .closure = &closure});
  };
  ForEachStanding(closures_, [&](const RecordKey& key, const LoopClosure& closure) {
    if (!quarantines_.HasFactor(key, KeyOf(closure))) select_closure(key, closure);
  });
  for (const auto& [ends, match] : matches_) {
    const RecordKey& key = match.version.second;
    if (!IsQuarantined(key, match.value)) select_closure(key, match.value.closure);
  }
  ForEachStanding(priors_, [&](const RecordKey& key, const NodePrior& prior) {
    if (!quarantines_.HasFactor(key, KeyOf(prior))) selection.graph.priors.push_back(prior);
  });
  std::size_t level = 0;
  for (auto& [origin, of_origin] : extras) {
    level = std::max(level, of_origin.size());
    std::sort(of_origin.begin(), of_origin.end(),
              [](const Extra& a, const Extra& b) { return AgeOf(a.key) > AgeOf(b.key); });
  }
  const auto is_within_size = [&] {
    std::vector<std::pair<int, int>> joined = chain;
    for (const auto& [origin, of_origin] : extras) {
      for (std::size_t i = 0; i < std::min(level, of_origin.size()); ++i) joined.push_back(of_origin[i].joined);
    }
    return IsWithin(EstimateSolveSize(place_of.size(), joined, size), size);
  };
  while (level > 0 && !is_within_size()) level /= 2;
  for (const auto& [origin, of_origin] : extras) {
    if (of_origin.size() > level) selection.left_out[origin] += of_origin.size() - level;
    for (std::size_t i = 0; i < std::min(level, of_origin.size()); ++i) {
      if (of_origin[i].odometry != nullptr) selection.graph.odometry.push_back(*of_origin[i].odometry);
      if (of_origin[i].range != nullptr) selection.graph.ranges.push_back(*of_origin[i].range);
      if (of_origin[i].closure != nullptr) selection.graph.closures.push_back(*of_origin[i].closure);
    }
  }
  return selection;
}

bool KnownGraph::IsQuarantined(const RecordKey& key, const Match& match) const {
  const LoopClosure& closure = match.closure;
  return quarantines_.HasFactor(key, KeyOf(closure)) || quarantines_.HasMap(closure.from, match.from_timestamp_ns) ||
         quarantines_.HasMap(closure.to, match.to_timestamp_ns);
}

// Leaves out untied nodes and counts them in `left_out`, unless it is null.
std::vector<GraphNode> KnownGraph::SelectNodes(std::map<AgentId, std::uint64_t>* left_out) const {
  std::vector<std::pair<RecordKey, GraphNode>> all;
  ForEachStanding(nodes_, [&all](const RecordKey& key, const GraphNode& node) { all.emplace_back(key, node); });
  if (left_out != nullptr) LeaveOutUntied(all, *left_out);
  std::vector<GraphNode> selected;
  for (std::size_t i = 0; i < all.size(); ++i) {
    GraphNode node = all[i].second;
    if (quarantines_.HasNode(node.key)) {
      const std::optional<Pose> pose = ComposePose(selected, node, i + 1 < all.size() ? &all[i + 1].second : nullptr);
      if (!pose) continue;
      node.map_from_node = *pose;
    }
    selected.push_back(node);
  }
  return selected;
}

std::set<NodeKey> KnownGraph::FindTiedNodes() const {
  std::set<NodeKey> tied;
  for (const auto& [name, edge] : odometry_) tied.insert({edge.from, edge.to});
  for (const auto& [name, edge] : ranges_) tied.insert({edge.from, edge.to});
  for (const auto& [name, closure] : closures_) tied.insert({closure.from, closure.to});
  for (const auto& [name, prior] : priors_) tied.insert(prior.node);
  for (const auto& [ends, match] : matches_) tied.insert({ends.first, ends.second});
  return tied;
}

// Removes the oldest nodes of each agent that no edge or prior names, beyond kUntiedNodesMax.
void KnownGraph::LeaveOutUntied(std::vector<std::pair<RecordKey, GraphNode>>& nodes,
                                std::map<AgentId, std::uint64_t>& left_out) const {
  std::map<AgentId, std::vector<RecordAge>> ages;
  if (nodes.size() <= kUntiedNodesMax) return;
  const std::set<NodeKey> tied = FindTiedNodes();
  for (const auto& [key, node] : nodes) {
    if (!tied.contains(node.key)) ages[key.stream.origin].push_back(AgeOf(key));
  }
  for (auto& [origin, of_origin] : ages) std::sort(of_origin.begin(), of_origin.end(), std::greater<>());
  std::erase_if(nodes, [&](const auto& node) {
    const std::vector<RecordAge>& of_origin = ages[node.first.stream.origin];
    const bool is_left_out = of_origin.size() > kUntiedNodesMax && !tied.contains(node.second.key) &&
                             AgeOf(node.first) <= of_origin[kUntiedNodesMax];
    if (is_left_out) ++left_out[node.first.stream.origin];
    return is_left_out;
  });
}

std::map<NodeKey, Pose> KnownGraph::FindContinuations() const {
  std::map<AgentId, std::uint64_t> cut;
  node_quota_.CountLeftOut(cut);
  std::map<NodeKey, Pose> continuations;
  for (const auto& [agent, count] : cut) {
    const auto first = nodes_.lower_bound({NodeKey{agent, 0}, RecordKey()});
    if (first == nodes_.end() || first->first.first.agent != agent) continue;
    const NodeKey& node = first->first.first;
    const Pose* const pose = FindPublished(node);
    if (pose != nullptr && !IsPublishedUnplaced(node)) continuations[node] = *pose;
  }
  return continuations;
}

// Returns the pose of a quarantined node: that of the node before or after it, composed with odometry. `before`: the
// nodes selected so far. `next`: the next node; may be null. Returns nullopt if neither has odometry to the node.
std::optional<Pose> KnownGraph::ComposePose(const std::vector<GraphNode>& before, const GraphNode& node,
                                            const GraphNode* next) const {
  if (!before.empty()) {
    const OdometryEdge* step = FindOdometry(before.back().key, node.key);
    if (step != nullptr) return before.back().map_from_node * step->from_from_to;
  }
  if (next == nullptr || quarantines_.HasNode(next->key)) return std::nullopt;
  const OdometryEdge* step = FindOdometry(node.key, next->key);
  if (step == nullptr) return std::nullopt;
  return next->map_from_node * step->from_from_to.Inverse();
}

const OdometryEdge* KnownGraph::FindOdometry(const NodeKey& from, const NodeKey& to) const {
  const auto found = odometry_.lower_bound({EdgeName{from, to}, RecordKey()});
  return found == odometry_.end() || found->first.first != EdgeName{from, to} ? nullptr : &found->second;
}

std::map<AgentId, std::uint64_t> KnownGraph::CountLeftOut() const {
  std::map<AgentId, std::uint64_t> counts = left_out_published_;
  quarantines_.CountLeftOut(counts);
  node_quota_.CountLeftOut(counts);
  edge_quota_.CountLeftOut(counts);
  return counts;
}

Result<void> KnownGraph::AddPose(const RecordKey& key, const proto::OptimizedPose& pose) {
  const Result<Pose> map_from_node = FromProto(pose.map_from_node());
  if (!map_from_node) return tl::unexpected(map_from_node.error());
  const Version version{Run{OrderOf(pose.term()), pose.run()}, key};
  newest_run_ = std::max(newest_run_, version.first);
  const NodeKey node = FromProto(pose.node());
  if (poses_.size() >= limits_.nodes_max && !poses_.contains(node)) {
    ++left_out_published_[key.stream.origin];
    return {};
  }
  const PublishedPose published{*map_from_node, pose.ignores_raw_pose(), pose.is_unplaced()};
  const auto [entry, is_new] = poses_.try_emplace(node, Versioned<PublishedPose>{version, published});
  if (!is_new && version > entry->second.version) entry->second = {version, published};
  return {};
}

void KnownGraph::AddVerdict(const RecordKey& key, const proto::EdgeVerdict& verdict) {
  const Version version{Run{OrderOf(verdict.term()), verdict.run()}, key};
  newest_run_ = std::max(newest_run_, version.first);
  const FactorKey factor = KeyOf(verdict);
  if (verdicts_.size() >= limits_.edges_max && !verdicts_.contains(factor)) {
    ++left_out_published_[key.stream.origin];
    return;
  }
  const PublishedVerdict published{verdict.is_inlier(), verdict.residual_sigmas()};
  const auto [entry, is_new] = verdicts_.try_emplace(factor, Versioned<PublishedVerdict>{version, published});
  if (!is_new && version > entry->second.version) entry->second = {version, published};
}

// The run of a match does not count for newest_run_: it numbers matches, not solves.
Result<void> KnownGraph::AddMatch(const RecordKey& key, const proto::Record& record) {
  const proto::MapMatch& message = record.map_match();
  PoseGraph one;
  if (auto added = AddRecord(record, one); !added) return added;
  const LoopClosure& closure = one.closures.front();
  const EdgeName ends{closure.from, closure.to};
  if (matches_.size() >= limits_.edges_max && !matches_.contains(ends)) {
    ++left_out_published_[key.stream.origin];
    return {};
  }
  const Version version{Run{OrderOf(message.term()), message.run()}, key};
  const Match match{closure, message.from_timestamp_ns(), message.to_timestamp_ns()};
  const auto [entry, is_new] = matches_.try_emplace(ends, Versioned<Match>{version, match});
  if (!is_new && version > entry->second.version) entry->second = {version, match};
  return {};
}

LastSolution KnownGraph::FindLastSolution() const {
  LastSolution solution;
  for (const auto& [node, pose] : poses_) {
    if (const Pose* const published = FindPublished(node)) {
      solution.poses.emplace_hint(solution.poses.end(), node, *published);
    }
  }
  for (const auto& [factor, verdict] : verdicts_) solution.AddVerdict(factor, verdict.value.is_inlier);
  return solution;
}

bool KnownGraph::IsPublishedUnplaced(const NodeKey& node) const {
  const auto found = poses_.find(node);
  return found != poses_.end() && found->second.value.is_unplaced;
}

const Pose* KnownGraph::FindPublished(const NodeKey& node) const {
  const auto found = poses_.find(node);
  if (found == poses_.end()) return nullptr;
  const PublishedPose& published = found->second.value;
  return quarantines_.HasNode(node) && !published.ignores_raw_pose ? nullptr : &published.map_from_node;
}

std::map<NodeKey, Pose> KnownGraph::FindNewestPoses(const std::vector<GraphNode>& nodes) const {
  std::map<NodeKey, Pose> poses;
  for (const GraphNode& node : nodes) poses.emplace(node.key, node.map_from_node);
  PoseCarrier carrier;
  for (auto& [node, pose] : poses) {
    const Pose* raw = quarantines_.HasNode(node) ? nullptr : &pose;
    if (const auto valid = carrier.Next(node, raw, FindPublished(node), IsPublishedUnplaced(node))) {
      pose = valid->map_from_node;
    }
  }
  return poses;
}

const PublishedVerdict* KnownGraph::FindVerdict(const FactorKey& factor) const {
  const auto found = verdicts_.find(factor);
  return found == verdicts_.end() ? nullptr : &found->second.value;
}

std::vector<NodeKey> KnownGraph::NewestNodes() const {
  std::map<AgentId, NodeKey> newest;
  for (const auto& [name, node] : nodes_) newest[node.key.agent] = node.key;
  std::vector<NodeKey> nodes;
  for (const auto& [agent, node] : newest) nodes.push_back(node);
  return nodes;
}

std::uint64_t KnownGraph::LastRun(const proto::Term& term) const {
  return newest_run_.first == OrderOf(term) ? newest_run_.second : 0;
}

}  // namespace moondb
