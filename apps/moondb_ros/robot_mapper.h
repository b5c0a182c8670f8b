// RobotMapper: turns a robot's ROS messages into the records of its agent.
//
// Odometry decides when a node is made (NodePlanner); the node's map comes from the scans, or from the grids if the
// options name grid topics. A node without a usable scan or grid has no map. A message that cannot be used is counted
// and printed (TopicLog), and never stored. Not thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "apps/moondb_ros/frame_tree.h"
#include "apps/moondb_ros/grid_mapper.h"
#include "apps/moondb_ros/node_chain.h"
#include "apps/moondb_ros/node_planner.h"
#include "apps/moondb_ros/odometry_track.h"
#include "apps/moondb_ros/ros_messages.h"
#include "apps/moondb_ros/scan_mapper.h"
#include "apps/moondb_ros/topic_log.h"
#include "proto/record.pb.h"
#include "proto/ros.pb.h"

namespace moondb {

class RobotMapper {
 public:
  struct Options {
    AgentId agent = 0;
    NodeRule rule;
    proto::OdometryKind odometry_kind = proto::ODOMETRY_KIND_WHEEL;
    Pose first;           // As in NodeChain.
    std::string boot_id;  // As in proto::RosState.
    std::string odometry_topic = "/odom";
    std::string scan_topic = "/scan";
    std::vector<std::string> grid_topics;  // If not empty, maps come from these grids.
  };

  // The newest own node in the agent's store.
  struct Stored {
    std::uint64_t index = 0;
    std::int64_t timestamp_ns = 0;
    Pose map_from_node;  // Its raw pose.
    // The state that the last process saved; empty if it saved none.
    proto::RosState state;
  };

  // A node and its records, which the caller inserts together.
  struct Made {
    std::vector<proto::Record> records;
    proto::RosState state;  // To be saved once the records are inserted.
  };

  // `stored` is empty if the store has no own node. `log` must outlive this object.
  RobotMapper(Options options, std::optional<Stored> stored, TopicLog& log);

  // `has_room`: a node may be made now. Otherwise the next one comes later, and the step to it is longer.
  std::optional<Made> OnOdometry(const RosOdometry& message, bool has_room);
  void OnScan(RosScan message);
  // `topic` is an index of Options::grid_topics.
  void OnGrid(std::size_t topic, RosGrid message);
  void OnTransform(const RosTransform& message, bool is_static);

  const OdometryTrack& track() const { return track_; }
  const FrameTree& frames() const { return frames_; }
  const std::optional<NodeChain::Last>& last_node() const { return chain_.last(); }

 private:
  static NodeChain MakeChain(const Options& options, const std::optional<Stored>& stored);
  void Continue();  // Decides, at the first message, whether odometry goes on from the stored node.
  // Returns, and counts, whether a message lies so far ahead of odometry that its clock must be wrong.
  bool IsFromTheFuture(const std::string& topic, std::int64_t timestamp_ns);
  std::optional<TraversabilityMap> MapOf(const PlannedNode& node);
  proto::RosState StateAt(const PlannedNode& node) const;

  const Options options_;
  const std::optional<Stored> stored_;
  TopicLog& log_;
  OdometryTrack track_;
  FrameTree frames_;
  ScanMapper scans_;
  GridMapper grids_;
  NodePlanner planner_;
  NodeChain chain_;
};

}  // namespace moondb
