// OwnInserts: records that each agent's actors inserted into its StorageActor and that were confirmed: solved poses,
// events, and records of clients. Matches requests and replies by request id, and ignores inserts without one.
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
  // The agent's StorageActor is about to handle the insert request.
  void OnRequest(AgentId agent, const proto::Message& message);
  // An actor of the agent is about to handle the reply. Returns the records that the reply confirms as stored.
  std::vector<std::pair<RecordKey, proto::Record>> OnReply(AgentId agent, const proto::Message& message);
  // Drops the agent's open requests, which will not be answered. Returns whether there were any.
  bool Forget(AgentId agent);

 private:
  std::map<std::pair<AgentId, std::uint64_t>, proto::InsertRequest> asked_;  // Open requests by agent and request id.
};

}  // namespace moondb::simulation
