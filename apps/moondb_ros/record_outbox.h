// RecordOutbox: the records that wait for the agent, which may be down or have no room. Thread-safe.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>

#include "apps/moondb_ros/robot_mapper.h"

namespace moondb {

class RecordOutbox {
 public:
  static constexpr std::size_t kRecordsMax = 600;

  // Returns whether another node may be made. Nodes and odometry are never dropped: if only they wait, no more nodes
  // are made until there is room.
  bool HasRoom() const;
  // Adds a node's records. If more than kRecordsMax records wait, drops the oldest maps; returns how many.
  std::size_t Add(RobotMapper::Made made);

  // Waits until a node waits or Close was called, and returns the oldest node, which stays; nullopt once closed.
  std::optional<RobotMapper::Made> Next();
  // Removes the oldest node, which the agent has stored or refused.
  void Remove();
  void Close();

 private:
  std::size_t Count() const;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<RobotMapper::Made> waiting_;
  bool is_closed_ = false;
};

}  // namespace moondb
