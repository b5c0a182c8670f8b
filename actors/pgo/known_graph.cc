#include "actors/pgo/known_graph.h"

#include <algorithm>

namespace moondb {

Result<void> KnownGraph::Add(const proto::Record& record) {
  if (record.has_optimized_pose()) return AddPose(record.optimized_pose());
  if (record.has_edge_verdict()) {
    AddVerdict(record.edge_verdict());
    return {};
  }
  return AddRecord(record, graph_);
}

Result<void> KnownGraph::AddPose(const proto::OptimizedPose& pose) {
  const Result<Pose> map_from_node = FromProto(pose.map_from_node());
  if (!map_from_node) return tl::unexpected(map_from_node.error());
  const Version version{OrderOf(pose.term()), pose.run()};
  NoteRun(version);
  const auto [entry, is_new] = poses_.try_emplace(FromProto(pose.node()), Versioned<Pose>{version, *map_from_node});
  if (!is_new && version > entry->second.version) entry->second = {version, *map_from_node};
  return {};
}

void KnownGraph::AddVerdict(const proto::EdgeVerdict& verdict) {
  if (!verdict.is_range()) return;
  const Version version{OrderOf(verdict.term()), verdict.run()};
  NoteRun(version);
  const RangeKey range{FromProto(verdict.from()), FromProto(verdict.to())};
  const auto [entry, is_new] = verdicts_.try_emplace(range, Versioned<bool>{version, verdict.is_inlier()});
  if (!is_new && version > entry->second.version) entry->second = {version, verdict.is_inlier()};
}

void KnownGraph::NoteRun(const Version& version) { newest_run_ = std::max(newest_run_, version); }

LastSolution KnownGraph::FindLastSolution() const {
  LastSolution solution;
  for (const auto& [node, pose] : poses_) solution.poses.emplace_hint(solution.poses.end(), node, pose.value);
  for (const auto& [range, is_inlier] : verdicts_) {
    if (!is_inlier.value) solution.rejected.insert(range);
  }
  return solution;
}

const Pose* KnownGraph::FindPublished(const NodeKey& node) const {
  const auto found = poses_.find(node);
  return found == poses_.end() ? nullptr : &found->second.value;
}

bool KnownGraph::IsPublishedInlier(const RangeKey& range) const {
  const auto found = verdicts_.find(range);
  return found == verdicts_.end() || found->second.value;
}

std::uint64_t KnownGraph::LastRun(const proto::Term& term) const {
  return newest_run_.first == OrderOf(term) ? newest_run_.second : 0;
}

}  // namespace moondb
