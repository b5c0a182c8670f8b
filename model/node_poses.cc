#include "model/node_poses.h"

#include <algorithm>

#include "model/term.h"

namespace moondb {

void NodePoses::AddRaw(const RecordKey& key, const NodeKey& node, const Pose& map_from_node,
                       std::int64_t timestamp_ns) {
  auto& raw = nodes_[node].raw;
  const auto place =
      std::lower_bound(raw.begin(), raw.end(), key, [](const auto& a, const RecordKey& b) { return a.key < b; });
  if (place != raw.end() && place->key == key) return;
  raw.insert(place, {key, map_from_node, timestamp_ns});
  for (const auto& removed : quota_.Add(key, 1, node)) {
    const auto found = nodes_.find(removed.note);
    std::erase_if(found->second.raw, [&removed](const auto& pose) { return pose.key == removed.key; });
    if (found->second.raw.empty() && !found->second.optimized) nodes_.erase(found);
  }
}

void NodePoses::AddOptimized(const RecordKey& key, const NodeKey& node, const OptimizedPose& pose,
                             const proto::Term& term, std::uint64_t run) {
  OptimizedShare& share = optimized_shares_[node.agent];
  if (node.index < share.first_index) {
    ++share.left_out_count;
    return;
  }
  auto& optimized = nodes_[node].optimized;
  const bool is_first = !optimized;
  const Version version = std::tuple_cat(OrderOf(term), std::tuple(run, key));
  if (!is_first && version <= optimized->version) return;
  if (!is_first) share.placed_count -= optimized->pose.is_unplaced ? 0 : 1;
  share.placed_count += pose.is_unplaced ? 0 : 1;
  optimized = {version, pose};
  if (!is_first) return;
  ++share.count;
  if (++optimized_count_ > nodes_max_) DropOptimized();
}

// Drops the optimized pose with the lowest index of the agent with the most of them. If two agents have the most, the
// one with the higher id drops a pose. The kept poses depend only on the set of nodes, because an agent's number of
// kept poses at a full limit never grows.
void NodePoses::DropOptimized() {
  const auto has_fewer = [](const auto& a, const auto& b) { return a.second.count <= b.second.count; };
  auto most = optimized_shares_.begin();
  for (auto share = optimized_shares_.begin(); share != optimized_shares_.end(); ++share) {
    if (has_fewer(*most, *share)) most = share;
  }
  auto& [agent, share] = *most;
  auto node = nodes_.lower_bound({agent, share.first_index});
  while (!node->second.optimized) ++node;
  share.first_index = node->first.index + 1;
  ++share.left_out_count;
  --share.count;
  share.placed_count -= node->second.optimized->pose.is_unplaced ? 0 : 1;
  --optimized_count_;
  node->second.optimized.reset();
  if (node->second.raw.empty()) nodes_.erase(node);
}

Result<void> NodePoses::AddOptimized(const RecordKey& key, const proto::OptimizedPose& optimized) {
  const Result<Pose> pose = FromProto(optimized.map_from_node());
  if (!pose) return tl::unexpected(pose.error());
  AddOptimized(key, FromProto(optimized.node()), {*pose, optimized.ignores_raw_pose(), optimized.is_unplaced()},
               optimized.term(), optimized.run());
  return {};
}

const Pose* NodePoses::FindRaw(const NodeKey& node, bool is_quarantined) const {
  const auto found = nodes_.find(node);
  const bool has_pose = found != nodes_.end() && !found->second.raw.empty() && !is_quarantined;
  return has_pose ? &found->second.raw.front().map_from_node : nullptr;
}

const NodePoses::RawPose* NodePoses::FindRawRecord(const NodeKey& node) const {
  const auto found = nodes_.find(node);
  return found == nodes_.end() || found->second.raw.empty() ? nullptr : &found->second.raw.front();
}

const NodePoses::OptimizedPose* NodePoses::FindOptimized(const NodeKey& node, bool is_quarantined) const {
  const auto found = nodes_.find(node);
  return found == nodes_.end() ? nullptr : ValidOf(found->second, is_quarantined);
}

const NodePoses::OptimizedPose* NodePoses::ValidOf(const Poses& poses, bool is_quarantined) {
  if (!poses.optimized) return nullptr;
  const OptimizedPose& pose = poses.optimized->pose;
  return is_quarantined && !pose.ignores_raw_pose ? nullptr : &pose;
}

NodePoses::ValidPoses NodePoses::FindValid(const std::set<NodeKey>& quarantined) const {
  ValidPoses valid;
  valid.poses.reserve(nodes_.size());
  PoseCarrier carrier;
  for (const auto& [node, poses] : nodes_) {
    const bool is_quarantined = quarantined.contains(node);
    const Pose* raw = poses.raw.empty() || is_quarantined ? nullptr : &poses.raw.front().map_from_node;
    const OptimizedPose* optimized = ValidOf(poses, is_quarantined);
    const auto pose = carrier.Next(node, raw, optimized == nullptr ? nullptr : &optimized->map_from_node,
                                   optimized != nullptr && optimized->is_unplaced);
    if (pose) valid.poses.emplace_back(node, *pose);
    if (optimized != nullptr) {
      valid.cut_at.erase(node.agent);
    } else if (!pose && raw != nullptr) {
      valid.cut_at.try_emplace(node.agent, node.index);
    }
  }
  return valid;
}

const ValidPose* NodePoses::ValidPoses::Find(const NodeKey& node) const {
  const auto found = std::ranges::lower_bound(poses, node, {}, &std::pair<NodeKey, ValidPose>::first);
  return found == poses.end() || found->first != node ? nullptr : &found->second;
}

std::optional<bool> NodePoses::IsPlaced(AgentId agent) const {
  const auto share = optimized_shares_.find(agent);
  if (share == optimized_shares_.end() || share->second.count == 0) return std::nullopt;
  return share->second.placed_count > 0;
}

bool NodePoses::HasNode(AgentId agent) const {
  const auto node = nodes_.lower_bound({agent, 0});
  return node != nodes_.end() && node->first.agent == agent;
}

void NodePoses::CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const {
  for (const auto& [agent, share] : optimized_shares_) {
    if (share.left_out_count > 0) counts[agent] += share.left_out_count;
  }
  quota_.CountLeftOut(counts);
}

}  // namespace moondb
