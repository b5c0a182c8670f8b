#include "apps/moondb_ros/odometry_track.h"

#include <algorithm>
#include <cmath>

namespace moondb {
namespace {

constexpr double kSpeedMax_m_s = 5;
constexpr double kTurnMax_rad_s = 4;
constexpr double kGapMax_s = 1;  // A longer gap counts as this long.
// Added to what the speeds allow, because timestamps of messages a few milliseconds apart are not exact.
constexpr double kJitter_m = 0.1;
constexpr double kJitter_rad = 0.1;
constexpr double kQuaternionTolerance = 0.01;
constexpr int kOldMax = 100;  // Messages in turn with older timestamps, after which the track begins again.

}  // namespace

Result<Pose> CheckedPose(const Pose& pose) {
  if (!pose.position_m.allFinite() || !pose.orientation.coeffs().allFinite()) {
    return Fail(ErrorCode::kInvalid, "a number of the pose is not finite");
  }
  if (pose.position_m.cwiseAbs().maxCoeff() > kCoordinateMax_m) {
    return Fail(ErrorCode::kInvalid, "a coordinate of the pose is beyond 1e9 m");
  }
  if (std::abs(pose.orientation.norm() - 1) > kQuaternionTolerance) {
    return Fail(ErrorCode::kInvalid, "the length of the pose's quaternion is not 1");
  }
  return Pose{pose.position_m, pose.orientation.normalized()};
}

bool IsJump(const Pose& from, const Pose& to, double gap_s) {
  const double counted_s = std::min(gap_s, kGapMax_s);
  return (to.position_m - from.position_m).norm() > kSpeedMax_m_s * counted_s + kJitter_m ||
         from.orientation.angularDistance(to.orientation) > kTurnMax_rad_s * counted_s + kJitter_rad;
}

Pose Interpolated(const Pose& a, const Pose& b, double part) {
  return {a.position_m + part * (b.position_m - a.position_m), a.orientation.slerp(part, b.orientation)};
}

Result<void> OdometryTrack::Add(const RosOdometry& message) {
  const Result<Pose> pose = CheckedPose(message.frame_from_child);
  if (!pose) return tl::unexpected(pose.error());
  if (poses_.empty()) {
    if (message.frame.empty() || message.child.empty()) {
      return Fail(ErrorCode::kInvalid, "header.frame_id or child_frame_id is empty");
    }
    frame_ = message.frame;
    child_ = message.child;
    poses_.push_back({message.timestamp_ns, *pose, 0});
    odom_from_robot_ = *pose;
    return {};
  }
  if (message.frame != frame_ || message.child != child_) {
    return Fail(ErrorCode::kInvalid, "its frames are " + message.frame + " and " + message.child + ", but began as " +
                                         frame_ + " and " + child_ + ": only one program may publish this topic");
  }
  if (message.timestamp_ns <= newest_ns()) {
    // A message with a timestamp in the future, or a clock that was set back, must not end odometry for long.
    if (++old_count_ < kOldMax) return Fail(ErrorCode::kInvalid, "its timestamp is not after the one before");
    const Entry begin{message.timestamp_ns, poses_.back().track_from_robot, poses_.back().jump_count + 1};
    track_from_odom_ = begin.track_from_robot * pose->Inverse();
    track_from_odom_.orientation.normalize();
    odom_from_robot_ = *pose;
    poses_.assign(1, begin);
    old_count_ = 0;
    return {};
  }
  old_count_ = 0;
  const Entry& last = poses_.back();
  const double gap_s = static_cast<double>(message.timestamp_ns - last.timestamp_ns) * 1e-9;
  std::uint64_t jump_count = last.jump_count;
  if (IsJump(odom_from_robot_, *pose, gap_s)) {
    ++jump_count;
    track_from_odom_ = last.track_from_robot * pose->Inverse();
    track_from_odom_.orientation.normalize();
  }
  odom_from_robot_ = *pose;
  poses_.push_back({message.timestamp_ns, track_from_odom_ * *pose, jump_count});
  const auto oldest_ns = message.timestamp_ns - static_cast<std::int64_t>(kTrackKept_s * 1e9);
  // One older pose stays, so that every time that is kept lies between two poses.
  while (poses_.size() > kTrackPosesMax || (poses_.size() > 2 && poses_[1].timestamp_ns < oldest_ns))
    poses_.pop_front();
  return {};
}

std::optional<Pose> OdometryTrack::PoseAt(std::int64_t timestamp_ns) const {
  const auto next =
      std::lower_bound(poses_.begin(), poses_.end(), timestamp_ns,
                       [](const Entry& entry, std::int64_t timestamp) { return entry.timestamp_ns < timestamp; });
  if (next == poses_.end()) return std::nullopt;
  if (next->timestamp_ns == timestamp_ns) return next->track_from_robot;
  if (next == poses_.begin()) return std::nullopt;
  const Entry& before = *(next - 1);
  const double part = static_cast<double>(timestamp_ns - before.timestamp_ns) /
                      static_cast<double>(next->timestamp_ns - before.timestamp_ns);
  return Interpolated(before.track_from_robot, next->track_from_robot, part);
}

std::uint64_t OdometryTrack::JumpsUntil(std::int64_t timestamp_ns) const {
  const auto after =
      std::upper_bound(poses_.begin(), poses_.end(), timestamp_ns,
                       [](std::int64_t timestamp, const Entry& entry) { return timestamp < entry.timestamp_ns; });
  if (after != poses_.begin()) return (after - 1)->jump_count;
  return poses_.empty() ? 0 : poses_.front().jump_count;
}

}  // namespace moondb
