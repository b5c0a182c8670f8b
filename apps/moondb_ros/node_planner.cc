#include "apps/moondb_ros/node_planner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace moondb {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr double kDegree = 0.017453292519943295;
constexpr double kMove_m = 0.1;
constexpr double kTurn_rad = 5 * kDegree;

std::int64_t NextWholeSecond(std::int64_t timestamp_ns) {
  const std::int64_t floor_ns = timestamp_ns - ((timestamp_ns % kSecond_ns) + kSecond_ns) % kSecond_ns;
  return floor_ns == timestamp_ns ? timestamp_ns : floor_ns + kSecond_ns;
}

// `sigmas`: x y z (m), roll pitch yaw (rad).
proto::RelativePose StepOf(const Pose& from_from_to, const std::array<double, 6>& sigmas) {
  proto::RelativePose step;
  *step.mutable_from_from_to() = ToProto(from_from_to);
  for (std::size_t row = 0; row < sigmas.size(); ++row) {
    for (std::size_t column = row; column < sigmas.size(); ++column) {
      step.add_covariance(row == column ? sigmas[row] * sigmas[row] : 0);
    }
  }
  return step;
}

}  // namespace

proto::RelativePose OdometryStep(const Pose& from_from_to, const DrivenWay& way, proto::OdometryKind kind) {
  const double share = kind == proto::ODOMETRY_KIND_WHEEL ? 0.05 : 0.01;
  const double length_m = std::max(from_from_to.position_m.norm(), way.length_m);
  const double turn_rad = std::max(std::abs(from_from_to.Yaw()), way.turn_rad);
  const double plane_m = 0.01 + share * length_m;
  const double yaw_rad = 0.005 + 0.01 * length_m + share * turn_rad;
  return StepOf(from_from_to, {plane_m, plane_m, 0.3 * plane_m, 0.002, 0.002, yaw_rad});
}

proto::RelativePose UnsureStep(const Pose& from_from_to) {
  return StepOf(from_from_to, {5, 5, 5, 0.01, 0.01, 60 * kDegree});
}

bool NodePlanner::IsDue(const OdometryTrack& track) const {
  if (!last_) return true;
  const std::int64_t now_ns = track.newest_ns();
  const std::optional<Pose> pose = track.PoseAt(now_ns);
  const Pose step = last_->track_from_node.Inverse() * *pose;
  return step.position_m.norm() >= rule_.distance_m ||
         step.orientation.angularDistance(Eigen::Quaterniond::Identity()) >= rule_.turn_deg * kDegree ||
         static_cast<double>(now_ns - last_->timestamp_ns) * 1e-9 >= rule_.age_s;
}

void NodePlanner::MeasureWay(const OdometryTrack& track) {
  const Pose now = *track.PoseAt(track.newest_ns());
  if (!way_end_) way_end_ = now;
  const double move_m = (now.position_m - way_end_->position_m).norm();
  const double turn_rad = way_end_->orientation.angularDistance(now.orientation);
  if (move_m < kMove_m && turn_rad < kTurn_rad) return;
  way_.length_m += move_m;
  way_.turn_rad += turn_rad;
  way_end_ = now;
}

std::optional<PlannedNode> NodePlanner::Next(const OdometryTrack& track, bool has_room) {
  MeasureWay(track);
  if (!has_room) return std::nullopt;
  if (!planned_ns_) {
    if (!IsDue(track)) return std::nullopt;
    planned_ns_ = NextWholeSecond(track.newest_ns());
  }
  // Time may have gone back.
  if (*planned_ns_ > track.newest_ns() + kSecond_ns) planned_ns_ = NextWholeSecond(track.newest_ns());
  if (track.newest_ns() < *planned_ns_ + kWait_ns) return std::nullopt;
  const std::int64_t timestamp_ns = *planned_ns_;
  planned_ns_.reset();
  const std::optional<Pose> pose = track.PoseAt(timestamp_ns);
  if (!pose)
    return std::nullopt;  // Odometry paused for longer than the track keeps poses; the next message plans again.
  const std::uint64_t jump_count = track.JumpsUntil(timestamp_ns);
  const PlannedNode node{timestamp_ns, *pose, jump_count != (last_ ? last_->jump_count : 0),
                         std::exchange(way_, DrivenWay())};
  last_ = Last{timestamp_ns, *pose, jump_count};
  return node;
}

}  // namespace moondb
