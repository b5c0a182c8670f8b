// NodePlanner: decides where the robot's odometry becomes a pose-graph node, and how unsure the step to it is.
//
// A node is due once the robot has moved or turned far enough since the last one. It is also due after some time, so
// that a person who leaves does not stay in the map. It is made at the next whole second of UTC, with the robot's pose
// interpolated at that instant: all robots of a team then make their nodes at the same instants.
//
// Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>

#include "apps/moondb_ros/odometry_track.h"
#include "model/geometry.h"
#include "proto/record.pb.h"
#include "proto/ros.pb.h"

namespace moondb {

struct NodeRule {
  double distance_m = 1;
  double turn_deg = 30;
  double age_s = 60;
};

// The way that a robot drove and turned, there and back. Moves below 0.1 m and 5 degrees do not count, so that the
// noise of a robot that stands does not add up.
struct DrivenWay {
  double length_m = 0;
  double turn_rad = 0;
};

struct PlannedNode {
  std::int64_t timestamp_ns = 0;
  Pose track_from_node;
  bool is_after_jump = false;  // Odometry jumped since the last node.
  DrivenWay way{};             // Since the last node.
};

// Returns an odometry measurement. `from_from_to` is the step between two nodes, and `way` led from one to the other.
// The standard deviations are, with d the longer one of the step and the way, and s 5 % for wheels, or 1 % where a
// lidar or cameras correct the odometry:
//   - x, y: 0.01 m + s d; z: 0.3 of that; roll, pitch: 0.002 rad
//   - yaw: 0.005 rad + 0.01 rad/m d + s times the turn, of the step or the way
// A message's covariance is not used, because it is zero, constant or that of the whole way in most drivers.
proto::RelativePose OdometryStep(const Pose& from_from_to, const DrivenWay& way, proto::OdometryKind kind);
// Returns the measurement for a step over a jump: standard deviations of 5 m and, in yaw, 60 degrees. Roll and pitch
// stay within 0.01 rad, because odometry measures them against gravity, or not at all.
proto::RelativePose UnsureStep(const Pose& from_from_to);

class NodePlanner {
 public:
  // How long a node waits after its instant for the scans of that instant.
  static constexpr std::int64_t kWait_ns = 300'000'000;

  explicit NodePlanner(const NodeRule& rule) : rule_(rule) {}

  // Call after each message that the track accepted. Returns a node whose instant has passed; at most one per call, and
  // each node once. Without `has_room`, no node is made now, and the step to the next one is longer.
  std::optional<PlannedNode> Next(const OdometryTrack& track, bool has_room = true);

 private:
  struct Last {
    std::int64_t timestamp_ns = 0;
    Pose track_from_node;
    std::uint64_t jump_count = 0;
  };

  void MeasureWay(const OdometryTrack& track);
  bool IsDue(const OdometryTrack& track) const;

  const NodeRule rule_;
  DrivenWay way_;                // Since the last node.
  std::optional<Pose> way_end_;  // track_from_robot up to which `way_` is measured.
  std::optional<Last> last_;
  std::optional<std::int64_t> planned_ns_;
};

}  // namespace moondb
