// NodeChain: turns planned nodes into records: a node, the odometry from the node before, and the local map.
//
// Indices and raw poses continue those in the agent's store, also after a restart of this program. Whether odometry
// went on in between is decided from what the program saved with its last node (proto/ros.proto). If it did, the step
// between the two runs is measured; otherwise the step is unsure.
//
// Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "apps/moondb_ros/node_planner.h"
#include "model/error.h"
#include "model/ids.h"
#include "model/traversability_map.h"
#include "proto/record.pb.h"
#include "proto/ros.pb.h"

namespace moondb {

// Returns whether odometry that is at `now` may go on from the saved state. It does not
//   - if the computer was restarted, or the frame has another name;
//   - if the pose is farther away than a jump (odometry_track.h);
//   - if odometry is near its origin and was not there before, because its program was restarted;
//   - after more than a minute, because the step says nothing of the way that the robot drove.
bool IsContinued(const proto::RosState& saved, const proto::RosState& now);

class NodeChain {
 public:
  // A robot's newest own node.
  struct Last {
    std::uint64_t index = 0;
    std::int64_t timestamp_ns = 0;
    Pose map_from_node;  // Its raw pose.
    // Its pose in the frame `track` (odometry_track.h); nullopt if odometry did not go on from it.
    std::optional<Pose> track_from_node;
  };

  // `last` is the newest own node in the agent's store, nullopt if there is none. `first` is the raw pose of the first
  // node of an empty store: the robot's start in the frame `map`, or the identity if the start is unknown.
  NodeChain(AgentId agent, proto::OdometryKind kind, const Pose& first, std::optional<Last> last)
      : agent_(agent), kind_(kind), first_(first), last_(last) {}

  // Returns the records of a node, in the order in which they are to be inserted. `map` is null if the node has none.
  // Fails with kInvalid, and makes no node, if the node is not newer than the newest own node: simulated time began
  // again, or the clock was set back.
  Result<std::vector<proto::Record>> Next(const PlannedNode& node, const TraversabilityMap* map);

  // Sets where the last node lies in the frame `track`, so that the step from it is measured. Requires: a last node.
  void Continue(const Pose& track_from_last) { last_->track_from_node = track_from_last; }

  const std::optional<Last>& last() const { return last_; }

 private:
  const AgentId agent_;
  const proto::OdometryKind kind_;
  const Pose first_;
  std::optional<Last> last_;
};

}  // namespace moondb
