#include "apps/mcap/ros_messages.h"

#include <algorithm>
#include <cctype>

#include "apps/mcap/cdr_writer.h"
#include "model/check.h"

namespace moondb {
namespace {

#define MOONDB_ROS_PART "================================================================================\nMSG: "
#define MOONDB_ROS_TIME MOONDB_ROS_PART "builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
#define MOONDB_ROS_HEADER \
  MOONDB_ROS_PART "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" MOONDB_ROS_TIME
#define MOONDB_ROS_QUATERNION MOONDB_ROS_PART "geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
#define MOONDB_ROS_POSE                                                                          \
  MOONDB_ROS_PART "geometry_msgs/Pose\nPoint position\nQuaternion orientation\n" MOONDB_ROS_PART \
                  "geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n" MOONDB_ROS_QUATERNION

void AddTime(std::int64_t timestamp_ns, CdrWriter& cdr) {
  Check(timestamp_ns >= 0 && timestamp_ns <= kRosTimeMax_ns, "a time that ROS can express");
  cdr.Add(static_cast<std::int32_t>(timestamp_ns / 1'000'000'000));
  cdr.Add(static_cast<std::uint32_t>(timestamp_ns % 1'000'000'000));
}

void AddHeader(std::int64_t timestamp_ns, const std::string& frame, CdrWriter& cdr) {
  AddTime(timestamp_ns, cdr);
  cdr.Add(std::string_view(frame));
}

// geometry_msgs/Pose and geometry_msgs/Transform have the same fields.
void AddPose(const Pose& pose, CdrWriter& cdr) {
  for (int i = 0; i < 3; ++i) cdr.Add(pose.position_m[i]);
  for (int i = 0; i < 4; ++i) cdr.Add(pose.orientation.coeffs()[i]);  // x, y, z, w.
}

std::uint8_t LevelOf(Severity severity) {
  switch (severity) {
    case Severity::kWarning:
      return 30;
    case Severity::kError:
      return 40;
    case Severity::kInfo:
      break;
  }
  return 20;
}

}  // namespace

const RosType kOccupancyGridType{
    "nav_msgs/msg/OccupancyGrid",
    "std_msgs/Header header\nMapMetaData info\nint8[] data\n" MOONDB_ROS_HEADER MOONDB_ROS_PART
    "nav_msgs/MapMetaData\nbuiltin_interfaces/Time map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\n"
    "geometry_msgs/Pose origin\n" MOONDB_ROS_POSE};

const RosType kPoseStampedType{"geometry_msgs/msg/PoseStamped",
                               "std_msgs/Header header\nPose pose\n" MOONDB_ROS_HEADER MOONDB_ROS_POSE};

const RosType kTfMessageType{"tf2_msgs/msg/TFMessage",
                             "geometry_msgs/TransformStamped[] transforms\n" MOONDB_ROS_PART
                             "geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\nTransform "
                             "transform\n" MOONDB_ROS_HEADER MOONDB_ROS_PART
                             "geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n" MOONDB_ROS_PART
                             "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n" MOONDB_ROS_QUATERNION};

const RosType kLogType{"rcl_interfaces/msg/Log",
                       "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n"
                       "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n"
                       "string function\nuint32 line\n" MOONDB_ROS_TIME};

std::string OccupancyGridMessage(const std::string& frame, const MapView& map) {
  CdrWriter cdr;
  AddHeader(map.timestamp_ns, frame, cdr);
  AddTime(map.timestamp_ns, cdr);
  cdr.Add(static_cast<float>(map.resolution_m()));
  cdr.Add(static_cast<std::uint32_t>(map.map.grid.width)).Add(static_cast<std::uint32_t>(map.map.grid.height));
  Pose origin;
  origin.position_m = {map.origin_x_m(), map.origin_y_m(), 0};
  AddPose(origin, cdr);
  cdr.AddSequence(map.Occupancy());
  return cdr.Take();
}

std::string PoseStampedMessage(const std::string& frame, std::int64_t timestamp_ns, const Pose& pose) {
  CdrWriter cdr;
  AddHeader(timestamp_ns, frame, cdr);
  AddPose(pose, cdr);
  return cdr.Take();
}

std::string TfMessage(const std::string& frame, const std::string& child, std::int64_t timestamp_ns, const Pose& pose) {
  CdrWriter cdr;
  cdr.AddCount(1);
  AddHeader(timestamp_ns, frame, cdr);
  cdr.Add(std::string_view(child));
  AddPose(pose, cdr);
  return cdr.Take();
}

std::string LogMessage(const std::string& agent, const EventView& event) {
  CdrWriter cdr;
  AddTime(event.timestamp_ns, cdr);
  cdr.Add(LevelOf(event.severity));
  cdr.Add(std::string_view(agent));
  cdr.Add(std::string_view(event.kind + ": " + event.TextBy()));
  cdr.Add(std::string_view("")).Add(std::string_view("")).Add(std::uint32_t{0});  // File, function and line.
  return cdr.Take();
}

std::string RosName(const std::string& agent) {
  std::string name = agent;
  std::ranges::replace(name, '-', '_');
  if (!name.empty() && std::isdigit(static_cast<unsigned char>(name.front())) != 0) name.insert(0, "agent_");
  return name;
}

}  // namespace moondb
