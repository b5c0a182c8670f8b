// The ROS 2 messages of an exported recording: their definitions, and their serialised form (CdrWriter). Thread-safe.
#pragma once

#include <string>

#include "model/geometry.h"
#include "views/event_view.h"
#include "views/map_view.h"

namespace moondb {

struct RosType {
  const char* name;        // "nav_msgs/msg/OccupancyGrid"
  const char* definition;  // The definition and those of the types that it contains (encoding "ros2msg").
};

extern const RosType kOccupancyGridType;
extern const RosType kPoseStampedType;
extern const RosType kTfMessageType;
extern const RosType kLogType;

// Limits of builtin_interfaces/Time: 1970 to 2038.
inline constexpr std::int64_t kRosTimeMax_ns = INT32_MAX * 1'000'000'000LL + 999'999'999;

// Return the serialised messages. Require: timestamps are within 0 to kRosTimeMax_ns.
std::string OccupancyGridMessage(const std::string& frame, const MapView& map);
std::string PoseStampedMessage(const std::string& frame, std::int64_t timestamp_ns, const Pose& pose);
// One transform: the pose of `child` in `frame`.
std::string TfMessage(const std::string& frame, const std::string& child, std::int64_t timestamp_ns, const Pose& pose);
// rcl_interfaces/Log, with the agent as name, and the event's kind before its text.
std::string LogMessage(const std::string& agent, const EventView& event);

// Returns the agent's name as a part of topic and frame names, which may have letters, digits and underscores, and do
// not begin with a digit.
std::string RosName(const std::string& agent);

}  // namespace moondb
