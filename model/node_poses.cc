#include "model/node_poses.h"

#include <algorithm>

#include "model/term.h"

namespace moondb {

void NodePoses::AddRaw(const RecordKey& key, const NodeKey& node, const Pose& map_from_node) {
  auto& raw = nodes_[node].raw;
  const auto place =
      std::lower_bound(raw.begin(), raw.end(), key, [](const auto& a, const RecordKey& b) { return a.first < b; });
  if (place != raw.end() && place->first == key) return;
  raw.emplace(place, key, map_from_node);
  for (const auto& removed : quota_.Add(key, 1, node)) {
    const auto found = nodes_.find(removed.note);
    std::erase_if(found->second.raw, [&removed](const auto& pose) { return pose.first == removed.key; });
    if (found->second.raw.empty() && !found->second.optimized) nodes_.erase(found);
  }
}

void NodePoses::AddOptimized(const RecordKey& key, const NodeKey& node, const Pose& map_from_node,
                             const proto::Term& term, std::uint64_t run, bool ignores_raw_pose) {
  const auto found = nodes_.find(node);
  const bool is_first = found == nodes_.end() || !found->second.optimized;
  if (is_first && optimized_count_ >= nodes_max_) {
    ++left_out_pose_count_[key.stream.origin];
    return;
  }
  optimized_count_ += is_first ? 1 : 0;
  auto& optimized = nodes_[node].optimized;
  const Version version = std::tuple_cat(OrderOf(term), std::tuple(run, key));
  if (!optimized || version > optimized->version) optimized = {version, map_from_node, ignores_raw_pose};
}

Result<void> NodePoses::AddOptimized(const RecordKey& key, const proto::OptimizedPose& optimized) {
  const Result<Pose> pose = FromProto(optimized.map_from_node());
  if (!pose) return tl::unexpected(pose.error());
  AddOptimized(key, FromProto(optimized.node()), *pose, optimized.term(), optimized.run(),
               optimized.ignores_raw_pose());
  return {};
}

const Pose* NodePoses::FindRaw(const NodeKey& node, bool is_quarantined) const {
  const auto found = nodes_.find(node);
  const bool has_pose = found != nodes_.end() && !found->second.raw.empty() && !is_quarantined;
  return has_pose ? &found->second.raw.front().second : nullptr;
}

const Pose* NodePoses::FindOptimized(const NodeKey& node, bool is_quarantined) const {
  const auto found = nodes_.find(node);
  if (found == nodes_.end() || !found->second.optimized) return nullptr;
  const OptimizedPose& pose = *found->second.optimized;
  return is_quarantined && !pose.ignores_raw_pose ? nullptr : &pose.map_from_node;
}

void NodePoses::CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const {
  for (const auto& [agent, count] : left_out_pose_count_) counts[agent] += count;
  quota_.CountLeftOut(counts);
}

}  // namespace moondb
