// RosBridge: a robot's ROS 2 graph on one side, its agent on the other (docs/ROS.md).
//
// Reads odometry, scans or grids, and transforms; inserts nodes, odometry and local maps at the agent; publishes the
// agent's merged map, and the transform from its frame to the robot's frames. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "apps/moondb_ros/agent_link.h"
#include "apps/moondb_ros/dds/ros_graph.h"
#include "apps/moondb_ros/robot_mapper.h"
#include "apps/moondb_ros/ros_inputs.h"
#include "apps/moondb_ros/ros_settings.h"
#include "apps/moondb_ros/topic_log.h"

namespace moondb {

class RosBridge {
 public:
  struct Options {
    RosSettings settings;
    AgentId agent = 0;
    Pose first;                   // As in NodeChain.
    bool is_start_known = false;  // As in TeamFrame.
    std::string boot_id;
    std::filesystem::path state_file;
    AgentLink::Connect connect;
    std::optional<RobotMapper::Stored> stored;  // As in RobotMapper.
    std::function<void(const std::string&)> print;
  };

  // Fails like RosGraph::Join.
  static Result<std::unique_ptr<RosBridge>> Start(Options options);
  RosBridge(const RosBridge&) = delete;
  RosBridge& operator=(const RosBridge&) = delete;

  // Works for at most about 100 ms: handles messages, and publishes what is due. Fails with kInvalid once the agent
  // refused a node: make a new bridge, which continues from the newest stored node.
  Result<void> Step();

 private:
  using Time = std::chrono::steady_clock::time_point;

  explicit RosBridge(Options options);
  Result<void> Join();
  RosGraph::Handlers MakeHandlers();
  void OnOdometry(const RosOdometry& message);
  void CheckAddresses(Time now);  // Joins again after the computer's addresses changed.
  void PublishMap(Time now);
  void WriteMap();  // Writes the last map, if there is one.
  // With is_published_as_map: another program publishes the map or the parent of the odometry frame.
  bool IsMapOfOthers() const;
  void PublishTransform(Time now);
  // The frame to which the team's map is joined: the highest ancestor of the odometry frame.
  std::string RootFrame() const;
  std::optional<Pose> MapFromRoot(const std::string& root);

  const Options options_;
  const std::vector<RosGraph::Input> inputs_;
  TopicLog log_;
  RobotMapper mapper_;
  AgentLink link_;
  std::unique_ptr<RosGraph> graph_;
  std::string addresses_;  // RosInterfaces::addresses at the last Join.
  RosGrid map_;            // The last one that was published; without cells before the first.
  Time addresses_read_{};
  Time map_written_{};
  Time transform_written_{};
};

}  // namespace moondb
