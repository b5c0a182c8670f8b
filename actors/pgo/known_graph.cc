#include "actors/pgo/known_graph.h"

#include <algorithm>

namespace moondb {

Result<void> KnownGraph::Add(const RecordKey& key, const proto::Record& record) {
  if (record.has_optimized_pose()) return AddPose(key, record.optimized_pose());
  if (record.has_edge_verdict()) {
    AddVerdict(key, record.edge_verdict());
    return {};
  }
  PoseGraph one;
  if (auto added = AddRecord(record, one); !added) return added;
  const auto name_of = [](const auto& edge) { return EdgeName{edge.from, edge.to}; };
  for (const GraphNode& node : one.nodes) AddItem(key, node.key, node, node_sources_, graph_.nodes);
  for (const OdometryEdge& edge : one.odometry) {
    AddItem(key, name_of(edge), edge, odometry_sources_, graph_.odometry);
  }
  for (const RangeEdge& edge : one.ranges) AddItem(key, name_of(edge), edge, range_sources_, graph_.ranges);
  return {};
}

template <typename Name, typename Item>
void KnownGraph::AddItem(const RecordKey& key, const Name& name, const Item& item, std::map<Name, Source>& sources,
                         std::vector<Item>& items) {
  const auto [source, is_new] = sources.try_emplace(name, Source{key, items.size()});
  if (is_new) {
    items.push_back(item);
  } else if (key < source->second.key) {
    source->second.key = key;
    items[source->second.place] = item;
  }
}

Result<void> KnownGraph::AddPose(const RecordKey& key, const proto::OptimizedPose& pose) {
  const Result<Pose> map_from_node = FromProto(pose.map_from_node());
  if (!map_from_node) return tl::unexpected(map_from_node.error());
  const Version version{Run{OrderOf(pose.term()), pose.run()}, key};
  newest_run_ = std::max(newest_run_, version.first);
  const auto [entry, is_new] = poses_.try_emplace(FromProto(pose.node()), Versioned<Pose>{version, *map_from_node});
  if (!is_new && version > entry->second.version) entry->second = {version, *map_from_node};
  return {};
}

void KnownGraph::AddVerdict(const RecordKey& key, const proto::EdgeVerdict& verdict) {
  if (!verdict.is_range()) return;
  const Version version{Run{OrderOf(verdict.term()), verdict.run()}, key};
  newest_run_ = std::max(newest_run_, version.first);
  const RangeKey range{FromProto(verdict.from()), FromProto(verdict.to())};
  const PublishedVerdict published{verdict.is_inlier(), verdict.residual_sigmas()};
  const auto [entry, is_new] = verdicts_.try_emplace(range, Versioned<PublishedVerdict>{version, published});
  if (!is_new && version > entry->second.version) entry->second = {version, published};
}

LastSolution KnownGraph::FindLastSolution() const {
  LastSolution solution;
  for (const auto& [node, pose] : poses_) solution.poses.emplace_hint(solution.poses.end(), node, pose.value);
  for (const auto& [range, verdict] : verdicts_) {
    if (!verdict.value.is_inlier) solution.rejected.insert(range);
  }
  return solution;
}

const Pose* KnownGraph::FindPublished(const NodeKey& node) const {
  const auto found = poses_.find(node);
  return found == poses_.end() ? nullptr : &found->second.value;
}

const Pose& KnownGraph::NewestPose(const GraphNode& node) const {
  const Pose* published = FindPublished(node.key);
  return published == nullptr ? node.map_from_node : *published;
}

const PublishedVerdict* KnownGraph::FindVerdict(const RangeKey& range) const {
  const auto found = verdicts_.find(range);
  return found == verdicts_.end() ? nullptr : &found->second.value;
}

bool KnownGraph::IsPublishedInlier(const RangeKey& range) const {
  const PublishedVerdict* verdict = FindVerdict(range);
  return verdict == nullptr || verdict->is_inlier;
}

std::vector<NodeKey> KnownGraph::NewestNodes() const {
  std::map<AgentId, NodeKey> newest;
  for (const auto& [node, source] : node_sources_) newest[node.agent] = node;
  std::vector<NodeKey> nodes;
  for (const auto& [agent, node] : newest) nodes.push_back(node);
  return nodes;
}

std::uint64_t KnownGraph::LastRun(const proto::Term& term) const {
  return newest_run_.first == OrderOf(term) ? newest_run_.second : 0;
}

}  // namespace moondb
