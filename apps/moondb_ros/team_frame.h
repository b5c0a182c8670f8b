// TeamFrame: where a robot's odometry lies in the team's map: the transform that moondb_ros publishes.
//
// The value is the valid pose of the newest own node that has one (model/pose_carrier.h) times that node's inverse pose
// in the frame `track` (odometry_track.h). Between two solves the robot thus moves by odometry alone, and after a solve
// it is where the solve placed it. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include "model/geometry.h"
#include "model/ids.h"
#include "model/node_poses.h"
#include "proto/record.pb.h"

namespace moondb {

class TeamFrame {
 public:
  static constexpr std::size_t kNodesMax = 100'000;

  // `is_start_known`: raw poses lie in the team's map, so the robot is placed before the first solve.
  TeamFrame(AgentId agent, bool is_start_known) : agent_(agent), is_start_known_(is_start_known), poses_(kNodesMax) {}

  // Adds a record of the agent's store: own nodes and optimized poses of own nodes count, all others are ignored.
  void Add(const proto::StoredRecord& stored, const proto::Record& record);
  // Adds where a node of this process lies in the frame `track`.
  void AddTrack(std::uint64_t node_index, const Pose& track_from_node);

  // Returns team_map_from_track; nullopt before the store has a node of this process, and while the robot is not
  // placed.
  std::optional<Pose> TeamFromTrack();

 private:
  std::optional<Pose> Find() const;

  AgentId agent_;
  bool is_start_known_;
  NodePoses poses_;
  std::map<std::uint64_t, Pose> track_from_node_;  // By node index, at most kNodesMax, the newest.
  std::optional<Pose> team_from_track_;            // Valid unless is_changed_.
  bool is_changed_ = false;
};

}  // namespace moondb
