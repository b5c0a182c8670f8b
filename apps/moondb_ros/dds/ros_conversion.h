// Conversions between ROS messages in the form that Cyclone reads and writes, and those of moondb_ros
// (apps/moondb_ros/ros_messages.h). `epoch_ns` is the time at which the messages' clock shows 0: 0 for UTC, the
// simulated epoch for simulated time. Thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "apps/moondb_ros/dds/ros.h"
#include "apps/moondb_ros/ros_messages.h"

namespace moondb {

RosOdometry FromDds(const nav_msgs_msg_dds__Odometry_& message, std::int64_t epoch_ns);
RosScan FromDds(const sensor_msgs_msg_dds__LaserScan_& message, std::int64_t epoch_ns);
RosGrid FromDds(const nav_msgs_msg_dds__OccupancyGrid_& message, std::int64_t epoch_ns);
std::vector<RosTransform> FromDds(const tf2_msgs_msg_dds__TFMessage_& message, std::int64_t epoch_ns);

// Calls `write` with the message, which is valid during the call.
template <typename Write>
auto WithDds(const RosGrid& grid, std::int64_t epoch_ns, const Write& write);
template <typename Write>
auto WithDds(const RosTransform& transform, std::int64_t epoch_ns, const Write& write);

builtin_interfaces_msg_dds__Time_ ToDdsTime(std::int64_t timestamp_ns, std::int64_t epoch_ns);
geometry_msgs_msg_dds__Quaternion_ ToDds(const Eigen::Quaterniond& orientation);

template <typename Write>
auto WithDds(const RosGrid& grid, std::int64_t epoch_ns, const Write& write) {
  nav_msgs_msg_dds__OccupancyGrid_ message{};
  // The fields of C have no const; writing does not change them.
  message.header.stamp = ToDdsTime(grid.timestamp_ns, epoch_ns);
  message.header.frame_id = const_cast<char*>(grid.frame.c_str());
  message.info.map_load_time = message.header.stamp;
  message.info.resolution = static_cast<float>(grid.resolution_m);
  message.info.width = grid.width;
  message.info.height = grid.height;
  const Eigen::Vector3d& origin_m = grid.frame_from_origin.position_m;
  message.info.origin.position = {origin_m.x(), origin_m.y(), origin_m.z()};
  message.info.origin.orientation = ToDds(grid.frame_from_origin.orientation);
  message.data._buffer = const_cast<std::int8_t*>(grid.values.data());
  message.data._length = message.data._maximum = static_cast<std::uint32_t>(grid.values.size());
  return write(message);
}

template <typename Write>
auto WithDds(const RosTransform& transform, std::int64_t epoch_ns, const Write& write) {
  geometry_msgs_msg_dds__TransformStamped_ stamped{};
  stamped.header.stamp = ToDdsTime(transform.timestamp_ns, epoch_ns);
  stamped.header.frame_id = const_cast<char*>(transform.parent.c_str());
  stamped.child_frame_id = const_cast<char*>(transform.child.c_str());
  const Eigen::Vector3d& position_m = transform.parent_from_child.position_m;
  stamped.transform.translation = {position_m.x(), position_m.y(), position_m.z()};
  stamped.transform.rotation = ToDds(transform.parent_from_child.orientation);
  tf2_msgs_msg_dds__TFMessage_ message{};
  message.transforms._buffer = &stamped;
  message.transforms._length = message.transforms._maximum = 1;
  return write(message);
}

}  // namespace moondb
