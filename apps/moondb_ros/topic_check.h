// The command `moondb_ros check`: listens to a robot's topics and prints what each of them becomes.
#pragma once

#include <chrono>

#include "apps/moondb_ros/ros_settings.h"
#include "model/error.h"

namespace moondb {

// Listens for `duration`, and prints a table and the problems found to stdout. Stores nothing, and needs no agent.
// Returns whether odometry and a source of maps work. Fails like RosGraph::Join.
Result<bool> CheckTopics(const RosSettings& settings, std::chrono::seconds duration);

}  // namespace moondb
