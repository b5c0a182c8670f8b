#include "apps/moondb_ros/team_frame.h"

#include <utility>

namespace moondb {

void TeamFrame::Add(const proto::StoredRecord& stored, const proto::Record& record) {
  const RecordKey key = FromProto(stored.key());
  is_changed_ = true;
  if (record.has_optimized_pose()) {
    if (FromProto(record.optimized_pose().node()).agent != agent_) return;
    (void)poses_.AddOptimized(key, record.optimized_pose());  // A damaged pose is left out, as in the merged map.
  } else if (record.has_pose_graph_node()) {
    const NodeKey node = FromProto(record.pose_graph_node().node());
    const Result<Pose> pose = FromProto(record.pose_graph_node().map_from_node());
    if (node.agent == agent_ && pose) poses_.AddRaw(key, node, *pose, record.timestamp_ns());
  }
}

void TeamFrame::AddTrack(std::uint64_t node_index, const Pose& track_from_node) {
  is_changed_ = true;
  track_from_node_[node_index] = track_from_node;
  if (track_from_node_.size() > kNodesMax) track_from_node_.erase(track_from_node_.begin());
}

std::optional<Pose> TeamFrame::TeamFromTrack() {
  if (std::exchange(is_changed_, false)) team_from_track_ = Find();
  return team_from_track_;
}

std::optional<Pose> TeamFrame::Find() const {
  const NodePoses::ValidPoses valid = poses_.FindValid({});
  for (auto node = track_from_node_.rbegin(); node != track_from_node_.rend(); ++node) {
    const ValidPose* pose = valid.Find(NodeKey{agent_, node->first});
    if (pose == nullptr) continue;
    if (pose->is_unplaced || (pose->source == PoseSource::kRaw && !is_start_known_)) return std::nullopt;
    Pose team_from_track = pose->map_from_node * node->second.Inverse();
    team_from_track.orientation.normalize();
    return team_from_track;
  }
  return std::nullopt;
}

}  // namespace moondb
