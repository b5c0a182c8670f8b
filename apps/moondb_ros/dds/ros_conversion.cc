#include "apps/moondb_ros/dds/ros_conversion.h"

namespace moondb {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

std::int64_t TimeOf(const std_msgs_msg_dds__Header_& header, std::int64_t epoch_ns) {
  return epoch_ns + header.stamp.sec * kSecond_ns + header.stamp.nanosec;
}

Eigen::Quaterniond FromDds(const geometry_msgs_msg_dds__Quaternion_& quaternion) {
  return {quaternion.w, quaternion.x, quaternion.y, quaternion.z};
}

Pose FromDds(const geometry_msgs_msg_dds__Pose_& pose) {
  return {{pose.position.x, pose.position.y, pose.position.z}, FromDds(pose.orientation)};
}

}  // namespace

builtin_interfaces_msg_dds__Time_ ToDdsTime(std::int64_t timestamp_ns, std::int64_t epoch_ns) {
  const std::int64_t after_ns = timestamp_ns - epoch_ns;
  const std::int64_t nanosec = ((after_ns % kSecond_ns) + kSecond_ns) % kSecond_ns;
  return {static_cast<std::int32_t>((after_ns - nanosec) / kSecond_ns), static_cast<std::uint32_t>(nanosec)};
}

geometry_msgs_msg_dds__Quaternion_ ToDds(const Eigen::Quaterniond& orientation) {
  return {orientation.x(), orientation.y(), orientation.z(), orientation.w()};
}

RosOdometry FromDds(const nav_msgs_msg_dds__Odometry_& message, std::int64_t epoch_ns) {
  return {TimeOf(message.header, epoch_ns), message.header.frame_id, message.child_frame_id,
          FromDds(message.pose.pose)};
}

RosScan FromDds(const sensor_msgs_msg_dds__LaserScan_& message, std::int64_t epoch_ns) {
  RosScan scan;
  scan.timestamp_ns = TimeOf(message.header, epoch_ns);
  scan.frame = message.header.frame_id;
  scan.angle_min_rad = message.angle_min;
  scan.angle_increment_rad = message.angle_increment;
  scan.time_increment_s = message.time_increment;
  scan.range_min_m = message.range_min;
  scan.range_max_m = message.range_max;
  scan.ranges_m.assign(message.ranges._buffer, message.ranges._buffer + message.ranges._length);
  return scan;
}

RosGrid FromDds(const nav_msgs_msg_dds__OccupancyGrid_& message, std::int64_t epoch_ns) {
  RosGrid grid;
  grid.timestamp_ns = TimeOf(message.header, epoch_ns);
  grid.frame = message.header.frame_id;
  grid.resolution_m = message.info.resolution;
  grid.width = message.info.width;
  grid.height = message.info.height;
  grid.frame_from_origin = FromDds(message.info.origin);
  grid.values.assign(message.data._buffer, message.data._buffer + message.data._length);
  return grid;
}

std::vector<RosTransform> FromDds(const tf2_msgs_msg_dds__TFMessage_& message, std::int64_t epoch_ns) {
  std::vector<RosTransform> transforms;
  for (std::uint32_t i = 0; i < message.transforms._length; ++i) {
    const geometry_msgs_msg_dds__TransformStamped_& stamped = message.transforms._buffer[i];
    const geometry_msgs_msg_dds__Vector3_& position = stamped.transform.translation;
    transforms.push_back({TimeOf(stamped.header, epoch_ns), stamped.header.frame_id, stamped.child_frame_id,
                          Pose{{position.x, position.y, position.z}, FromDds(stamped.transform.rotation)}});
  }
  return transforms;
}

}  // namespace moondb
