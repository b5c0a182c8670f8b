// OdometryTrack: the robot's recent odometry, without jumps.
//
// Odometry that is restarted or relocalized jumps: between two messages the robot seems to move faster than 5 m/s or to
// turn faster than 4 rad/s. The track continues across a jump as if the robot had stood still, so that it stays
// continuous. Two frames follow from that:
//   - odom: the frame of the messages, in which the robot's pose may jump.
//   - track: equals odom until the first jump.
// Plain value, not thread-safe. Keeps kTrackKept_s, and at most kTrackPosesMax poses.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "apps/moondb_ros/ros_messages.h"
#include "model/error.h"
#include "model/geometry.h"

namespace moondb {

inline constexpr double kTrackKept_s = 10;
inline constexpr std::size_t kTrackPosesMax = 20'000;

// Returns the pose with a normalized quaternion. Fails with kInvalid for a number that is not finite, a coordinate
// beyond kCoordinateMax_m, or a quaternion whose length differs from 1 by more than 1 %.
Result<Pose> CheckedPose(const Pose& pose);

// Returns whether odometry moved faster than a robot can: faster than 5 m/s or 4 rad/s, where a gap of more than 1 s
// counts as 1 s.
bool IsJump(const Pose& from, const Pose& to, double gap_s);

// Interpolates linearly; `part` is 0 at `a` and 1 at `b`.
Pose Interpolated(const Pose& a, const Pose& b, double part);

class OdometryTrack {
 public:
  // Adds a message. Fails with kInvalid, and leaves the track as it is, for a pose that CheckedPose refuses, a
  // timestamp not after the last one, or frames unlike those of the first message. After 100 such timestamps in turn
  // the track begins again, which counts as a jump.
  Result<void> Add(const RosOdometry& message);

  bool is_empty() const { return poses_.empty(); }
  const std::string& frame() const { return frame_; }  // Frame of the odometry; empty before the first message.
  const std::string& child() const { return child_; }  // Frame of the robot.
  // The newest timestamp. Requires: the track is not empty.
  std::int64_t newest_ns() const { return poses_.back().timestamp_ns; }
  // Returns track_from_robot at a time, interpolated; nullopt outside of the poses that are kept.
  std::optional<Pose> PoseAt(std::int64_t timestamp_ns) const;
  // Returns the number of jumps until a time that is kept: a step between two times with different counts is unsure.
  std::uint64_t JumpsUntil(std::int64_t timestamp_ns) const;
  // Identity before the first jump.
  const Pose& track_from_odom() const { return track_from_odom_; }

 private:
  struct Entry {
    std::int64_t timestamp_ns = 0;
    Pose track_from_robot;
    std::uint64_t jump_count = 0;  // Jumps so far, the one to this entry included.
  };

  std::string frame_;
  std::string child_;
  Pose track_from_odom_;
  Pose odom_from_robot_;  // The pose of the last message.
  int old_count_ = 0;     // Messages in turn with timestamps not after the last one.
  std::deque<Entry> poses_;
};

}  // namespace moondb
