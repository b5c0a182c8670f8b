// Starts and ends moondb_ros beside an agent of this machine, for `up --with ros` and `down`.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>

namespace moondb {

struct RosCommand {
  std::filesystem::path program;    // Path of moondb_ros.
  std::filesystem::path team_file;  // `ros.yaml` beside it holds the settings, if it exists.
  std::string agent;
  std::string name_space;  // Prefix of all topics; empty: that of the settings.
};

struct RosOutcome {
  pid_t pid = 0;      // 0: not running.
  std::string state;  // "started", or what went wrong.
  bool is_failed = false;
};

// Starts moondb_ros unless it runs, and waits until it takes part in the ROS graph. One that waits for longer than 10
// s, for example for the agent's lost nodes, is left running, and `state` is its last line.
RosOutcome StartRos(const RosCommand& command, const std::filesystem::path& data_folder);

// Ends moondb_ros, if StartRos started it. `state` is empty if there is nothing to end.
RosOutcome StopRos(const std::filesystem::path& data_folder);

}  // namespace moondb
