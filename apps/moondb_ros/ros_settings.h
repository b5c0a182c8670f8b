// RosSettings: the settings of moondb_ros, from its YAML file (proto/ros.proto, RosConfig) and the command line.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/moondb_ros/node_planner.h"
#include "model/error.h"

namespace moondb {

struct RosSettings {
  std::string team;
  std::string agent;
  std::string data_folder;  // The agent's own. Empty: its default.
  // Names of topics, below `name_space`.
  std::string odometry_topic;
  std::string scan_topic;
  std::vector<std::string> grid_topics;  // If not empty, maps come from these grids and not from the scan.
  std::string name_space;                // "robot1": topics are /robot1/odom and so on. Empty: none.
  NodeRule rule;
  proto::OdometryKind odometry_kind = proto::ODOMETRY_KIND_WHEEL;
  bool is_published_as_map = false;  // The map's topic and frame are `map` and not `team_map`.
  bool is_simulated_time = false;    // Timestamps of messages count from sim_epoch_ns.
  std::int64_t sim_epoch_ns = 0;
  std::uint32_t domain_id = 0;

  std::string TopicName(const std::string& topic) const;  // "/robot1/odom" of "/odom".
  std::string MapTopic() const { return TopicName(is_published_as_map ? "/map" : "/team_map"); }
  std::string MapFrame() const { return is_published_as_map ? "map" : "team_map"; }
  std::int64_t EpochNs() const { return is_simulated_time ? sim_epoch_ns : 0; }
};

// Returns the settings of the YAML text `yaml`, with all defaults; "{}" gives the defaults alone. `name` is the file's
// name in errors. Fails with kInvalid; Error::text holds one error per line, each with its place in the file.
Result<RosSettings> ParseRosSettings(const std::string& yaml, const std::string& name);

}  // namespace moondb
