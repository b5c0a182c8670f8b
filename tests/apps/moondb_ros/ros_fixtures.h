// Messages of a simulated robot, for the tests of moondb_ros.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/moondb_ros/frame_tree.h"
#include "apps/moondb_ros/odometry_track.h"
#include "apps/moondb_ros/ros_messages.h"

namespace moondb {

inline constexpr std::int64_t kTestStart_ns = 1'800'000'000'000'000'000;  // A whole second, in 2027.

inline std::int64_t At(double seconds) { return kTestStart_ns + static_cast<std::int64_t>(seconds * 1e9); }

inline RosOdometry OdometryAt(double seconds, const Pose& odom_from_robot) {
  return {At(seconds), "odom", "base_link", odom_from_robot};
}

// A robot that drives along x at 1 m/s, heard `rate_hz` times a second.
inline void Drive(OdometryTrack& track, double from_s, double to_s, double rate_hz = 20) {
  for (int i = 0; from_s + i / rate_hz <= to_s + 1e-9; ++i) {
    const double seconds = from_s + i / rate_hz;
    (void)track.Add(OdometryAt(seconds, Pose::FromPlanar(seconds, 0, 0)));
  }
}

inline RosTransform TransformAt(double seconds, const std::string& parent, const std::string& child, const Pose& pose) {
  return {At(seconds), parent, child, pose};
}

// A scan of `count` rays from -pi to pi, all of `range_m`.
inline RosScan ScanAt(double seconds, float range_m, std::size_t count = 720) {
  RosScan scan;
  scan.timestamp_ns = At(seconds);
  scan.frame = "laser";
  scan.angle_min_rad = -3.14159265358979;
  scan.angle_increment_rad = 2 * 3.14159265358979 / static_cast<double>(count);
  scan.range_min_m = 0.1;
  scan.range_max_m = 12;
  scan.ranges_m.assign(count, range_m);
  return scan;
}

// A grid of `side` x `side` unknown cells of 5 cm, centred on the origin of `frame`.
inline RosGrid GridAt(double seconds, const std::string& frame, std::uint32_t side = 200) {
  RosGrid grid;
  grid.timestamp_ns = At(seconds);
  grid.frame = frame;
  grid.resolution_m = 0.05;
  grid.width = grid.height = side;
  grid.frame_from_origin.position_m = {-0.025 * side, -0.025 * side, 0};
  grid.values.assign(std::size_t{side} * side, -1);
  return grid;
}

}  // namespace moondb
