// AgentLink: the connections of moondb_ros to its agent: inserts records, and follows the merged map and the poses.
//
// Three threads with one Client each. While the agent is down they retry each second, and say so once. Thread-safe.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "apps/moondb_ros/record_inserter.h"
#include "apps/moondb_ros/record_outbox.h"
#include "apps/moondb_ros/robot_mapper.h"
#include "apps/moondb_ros/team_frame.h"
#include "apps/moondb_ros/team_map_image.h"
#include "client/client.h"

namespace moondb {

// Returns the newest own node in the agent's store, without the saved state; nullopt if the store has none. The error
// is that of Client::ReadAll.
Result<std::optional<RobotMapper::Stored>> ReadNewestNode(Client& client, AgentId agent);

// The state that moondb_ros saved in `file`; empty if there is none, or if the file is damaged.
proto::RosState ReadRosState(const std::filesystem::path& file);

class AgentLink {
 public:
  using Connect = std::function<Result<std::unique_ptr<Client>>()>;

  // `is_start_known`: as in TeamFrame. `print` prints one line, from any thread.
  AgentLink(AgentId agent, bool is_start_known, std::filesystem::path state_file, Connect connect,
            std::function<void(const std::string&)> print);
  ~AgentLink();  // Ends the threads, which may take some seconds. Records that still wait are lost.
  AgentLink(const AgentLink&) = delete;
  AgentLink& operator=(const AgentLink&) = delete;

  bool HasRoom() const { return outbox_.HasRoom(); }
  // Set once the agent refused a node. Nothing more is inserted, because later nodes would continue from it.
  std::optional<Error> Refusal() const;
  // Hands over a node's records. `track_from_node` is the node's pose in the frame `track`.
  void Insert(RobotMapper::Made made, const Pose& track_from_node);

  // Returns team_map_from_track (TeamFrame); nullopt while the robot is not placed in the team's map.
  std::optional<Pose> TeamFromTrack();
  // Returns the merged map if a cell changed since the last call. `robot_m`: as in TeamMapImage::ToGrid.
  std::optional<TeamMapImage::Picture> TakeNewMap(const Eigen::Vector2d& robot_m);

 private:
  // Runs `work` with a client until the link ends; connects again, a second later, after each error.
  void Repeat(const std::string& what, const std::function<Result<void>(Client&)>& work);
  Result<void> InsertNext(Client& client);
  void SaveState(const proto::RosState& state);
  Result<void> FollowMap(Client& client);
  Result<void> FollowPoses(Client& client);
  bool WaitASecond();  // False: the link ends.

  const AgentId agent_;
  const std::filesystem::path state_file_;
  const Connect connect_;
  const std::function<void(const std::string&)> print_;
  RecordOutbox outbox_;
  bool has_dropped_maps_ = false;  // Used by the thread of Insert.
  RecordInserter inserter_;        // Used by the thread that inserts.

  mutable std::mutex mutex_;
  std::condition_variable ended_;
  bool is_ended_ = false;
  std::optional<Error> refusal_;
  TeamFrame frame_;
  TeamMapImage image_;
  bool is_map_new_ = false;
  std::optional<AgentId> frame_of_;  // MergedTiles::frame_of; nullopt before the first map.
  std::vector<std::thread> threads_;
};

}  // namespace moondb
