// RecordInserter: inserts the records of nodes, one node after the other, at an agent that may be away, full, or refuse
// them. Not thread-safe.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/moondb_ros/robot_mapper.h"
#include "model/error.h"
#include "proto/record.pb.h"

namespace moondb {

class RecordInserter {
 public:
  // The requests to an agent. Their errors are those of Client.
  struct Agent {
    std::function<Result<void>(const std::vector<proto::Record>&)> insert;
    std::function<Result<std::optional<RobotMapper::Stored>>()> read_newest_node;
  };

  // `print` prints one line.
  explicit RecordInserter(std::function<void(const std::string&)> print) : print_(std::move(print)) {}

  // Inserts a node. A node whose map is refused, or for whose map there is no room, is inserted without the map.
  // Errors:
  //   - kInvalid: the agent refuses the node itself, so nodes after it must not continue from it;
  //   - all others: unknown whether the records are stored. Call again with the same node: if it is the newest stored
  //     one, it is not inserted a second time.
  Result<void> Insert(const RobotMapper::Made& made, const Agent& agent);

 private:
  Result<void> InsertWithoutMap(std::vector<proto::Record> records, const Agent& agent, const Error& with_map);

  const std::function<void(const std::string&)> print_;
  bool is_unsure_ = false;  // The last insert failed, but its records may have been stored.
  std::string printed_;     // The last reason for a missing map.
};

// The index of the node to which the records belong.
std::uint64_t IndexOf(const RobotMapper::Made& made);

}  // namespace moondb
