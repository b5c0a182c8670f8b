// OwnInserts: tracks the records that each agent's actors insert into its StorageActor (solved poses, events, and
// records of clients), and returns them once they are confirmed. Ignores inserts that are local or have no request id.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "model/record_key.h"
#include "proto/message.pb.h"

namespace moondb::simulation {

class OwnInserts {
 public:
  // Call before the agent's StorageActor handles `message`, an insert request.
  void OnRequest(AgentId agent, const proto::Message& message);
  // Call before an actor of the agent handles `message`, the reply. Returns the records that the reply confirms as
  // stored.
  std::vector<std::pair<RecordKey, proto::Record>> OnReply(AgentId agent, const proto::Message& message);
  // Call when the agent's process has ended. Drops the agent's open requests, and returns whether there were any.
  bool Forget(AgentId agent);

 private:
  std::map<std::pair<AgentId, std::uint64_t>, proto::InsertRequest> asked_;  // Open requests by agent and request id.
};

}  // namespace moondb::simulation
