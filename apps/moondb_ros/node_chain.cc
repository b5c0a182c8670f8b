#include "apps/moondb_ros/node_chain.h"

#include <string>

namespace moondb {
namespace {

constexpr double kOrigin_m = 0.5;
constexpr double kOrigin_rad = 0.2;
constexpr double kRestartGapMax_s = 60;  // In a longer time the robot may have driven far and come back.

bool IsAtOrigin(const Pose& pose) {
  return pose.position_m.norm() < kOrigin_m &&
         pose.orientation.angularDistance(Eigen::Quaterniond::Identity()) < kOrigin_rad;
}

proto::Record RecordAt(std::int64_t timestamp_ns) {
  proto::Record record;
  record.set_timestamp_ns(timestamp_ns);
  return record;
}

}  // namespace

bool IsContinued(const proto::RosState& saved, const proto::RosState& now) {
  const Result<Pose> before = FromProto(saved.odom_from_node());
  const Result<Pose> after = FromProto(now.odom_from_node());
  if (!before || !after || saved.boot_id() != now.boot_id() || saved.odometry_frame() != now.odometry_frame()) {
    return false;
  }
  const double gap_s = static_cast<double>(now.timestamp_ns() - saved.timestamp_ns()) * 1e-9;
  const bool has_begun_again = IsAtOrigin(*after) && !IsAtOrigin(*before);
  return gap_s > 0 && gap_s < kRestartGapMax_s && !has_begun_again && !IsJump(*before, *after, gap_s);
}

Result<std::vector<proto::Record>> NodeChain::Next(const PlannedNode& node, const TraversabilityMap* map) {
  if (last_ && node.timestamp_ns <= last_->timestamp_ns) {
    return Fail(ErrorCode::kInvalid,
                "odometry is older than node " + std::to_string(last_->index) +
                    " in the store: the clock went back. Set the clock right, or create a new team folder for a new "
                    "simulation");
  }
  const NodeKey key{agent_, last_ ? last_->index + 1 : 0};
  const bool is_measured = last_ && last_->track_from_node && !node.is_after_jump;
  const Pose step = last_ && last_->track_from_node ? last_->track_from_node->Inverse() * node.track_from_node : Pose();
  const Pose map_from_node = last_ ? last_->map_from_node * step : first_;

  std::vector<proto::Record> records;
  records.push_back(RecordAt(node.timestamp_ns));
  proto::PoseGraphNode& added = *records.back().mutable_pose_graph_node();
  *added.mutable_node() = ToProto(key);
  *added.mutable_map_from_node() = ToProto(map_from_node);
  if (last_) {
    records.push_back(RecordAt(node.timestamp_ns));
    proto::PoseGraphEdge& edge = *records.back().mutable_pose_graph_edge();
    *edge.mutable_from() = ToProto(NodeKey{agent_, last_->index});
    *edge.mutable_to() = ToProto(key);
    *edge.mutable_relative_pose() = is_measured ? OdometryStep(step, node.way, kind_) : UnsureStep(step);
  }
  if (map != nullptr) {
    records.push_back(RecordAt(node.timestamp_ns));
    TraversabilityMap of_node = *map;
    of_node.node = key;
    *records.back().mutable_local_traversability_map() = ToProto(of_node);
  }
  last_ = Last{key.index, node.timestamp_ns, map_from_node, node.track_from_node};
  return records;
}

}  // namespace moondb
