// RosGraph: takes part in the ROS 2 graph of this computer, by DDS (Eclipse Cyclone DDS), without ROS.
//
// Topics and types have the names that ROS 2 gives them on DDS: topic `rt/NAME`, type `pkg::msg::dds_::Name_`. A ROS
// program therefore sees ordinary publishers and subscribers. Their quality of service:
//   - Inputs are read with the reliability and durability that their writers offer, so that none stays unmatched.
//   - The map is reliable and transient local, so that late readers get it, as from map_server. It is written again
//   when
//     a reader joins, because rviz's reader is volatile. Transforms are reliable and volatile.
//   - A write waits at most 100 ms for a reader that does not read.
//
// This header includes nothing of DDS. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/moondb_ros/ros_messages.h"
#include "model/error.h"

namespace moondb {

class RosGraph {
 public:
  enum class Type { kOdometry, kScan, kGrid, kTransforms };

  struct Input {
    std::string topic;  // "/odom"
    Type type = Type::kOdometry;
    // The reader asks for the last message of before it joined, as soon as one publisher keeps it. It then hears no
    // publisher that keeps none, which is a mistake on /tf_static.
    bool is_latched = false;
  };

  struct Options {
    std::uint32_t domain_id = 0;
    std::vector<Input> inputs;
    std::string map_topic;  // Empty: no map is written.
    std::string tf_topic;   // Empty: no transforms are written.
    // The time at which the messages' clock shows 0, in nanoseconds since 1970: 0 for UTC.
    std::int64_t epoch_ns = 0;
  };

  // Called by Spin. `input` is an index of Options::inputs.
  struct Handlers {
    std::function<void(std::size_t input, const RosOdometry&)> on_odometry;
    std::function<void(std::size_t input, RosScan)> on_scan;
    std::function<void(std::size_t input, RosGrid)> on_grid;
    std::function<void(std::size_t input, const RosTransform&)> on_transform;
    // A publisher of the topic has another type.
    std::function<void(std::size_t input, const std::string& type, const std::string& expected)> on_other_type;
  };

  // A publisher of an input, as it announced itself.
  struct Publisher {
    std::string type;
    bool is_reliable = false;
    bool is_transient_local = false;
  };

  // Fails with kUnavailable if no participant can be made: 120 participants run on this computer, or no network.
  static Result<std::unique_ptr<RosGraph>> Join(Options options, Handlers handlers);
  ~RosGraph();
  RosGraph(const RosGraph&) = delete;
  RosGraph& operator=(const RosGraph&) = delete;

  // Waits at most `timeout` for messages, and calls the handlers with those that are there.
  void Spin(std::chrono::milliseconds timeout);

  // Fail with kTimedOut if a reader does not take the message within 100 ms, with kInternal for other errors of DDS.
  Result<void> WriteMap(const RosGrid& grid);
  Result<void> WriteTransform(const RosTransform& transform);

  // The publishers of an input that are known so far.
  std::vector<Publisher> PublishersOf(std::size_t input) const;
  // Returns whether another participant publishes this topic ("/map").
  bool IsPublishedByOthers(const std::string& topic) const;

 private:
  class Dds;
  explicit RosGraph(std::unique_ptr<Dds> dds);
  std::unique_ptr<Dds> dds_;
};

}  // namespace moondb
