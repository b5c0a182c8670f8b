// OwnInserts: tracks the records that each agent's actors insert into its StorageActor (solved poses, events, and
// records of clients), and reports them once they are confirmed. Matches requests and replies by request id, and
// ignores inserts without one.
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
  // Called before the agent's StorageActor handles the insert request.
  void OnRequest(AgentId agent, const proto::Message& message);
  // Called before an actor of the agent handles the reply. Returns the records that the reply confirms as stored.
  std::vector<std::pair<RecordKey, proto::Record>> OnReply(AgentId agent, const proto::Message& message);
  // Drops the agent's open requests, which will not be answered. Returns whether there were open requests.
  bool Forget(AgentId agent);

 private:
  std::map<std::pair<AgentId, std::uint64_t>, proto::InsertRequest> asked_;  // Open requests by agent and request id.
};

}  // namespace moondb::simulation
