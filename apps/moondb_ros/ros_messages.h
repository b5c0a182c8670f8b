// The parts of ROS messages that moondb_ros reads and writes, independent of DDS. Values are as received, so poses and
// numbers are not validated.
//
// Timestamps are nanoseconds since 1970, UTC; with simulated time they count from the simulated epoch (RosClock).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "model/geometry.h"

namespace moondb {

// geometry_msgs/TransformStamped.
struct RosTransform {
  std::int64_t timestamp_ns = 0;
  std::string parent;  // header.frame_id.
  std::string child;   // child_frame_id.
  Pose parent_from_child;
};

// nav_msgs/Odometry, without twist and covariances.
struct RosOdometry {
  std::int64_t timestamp_ns = 0;
  std::string frame;  // header.frame_id: the odometry frame.
  std::string child;  // child_frame_id: the robot's frame.
  Pose frame_from_child;
};

// sensor_msgs/LaserScan, without intensities.
struct RosScan {
  std::int64_t timestamp_ns = 0;  // Time of the first ray.
  std::string frame;
  double angle_min_rad = 0;
  double angle_increment_rad = 0;
  double time_increment_s = 0;  // Time between two rays; 0 if unknown.
  double range_min_m = 0;
  double range_max_m = 0;
  std::vector<float> ranges_m;
};

// nav_msgs/OccupancyGrid.
struct RosGrid {
  std::int64_t timestamp_ns = 0;
  std::string frame;
  double resolution_m = 0;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  Pose frame_from_origin;           // The lower left corner of cell (0, 0).
  std::vector<std::int8_t> values;  // Row by row: -1 unknown, 0 free, 100 occupied.
};

}  // namespace moondb
