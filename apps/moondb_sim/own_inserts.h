// OwnInserts: what each agent's actors gave its StorageActor to insert, and got an answer for: solved poses, events,
// what clients gave the gateway. Requests are known again by their ids; what goes in without one is not looked at.
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
  // Its StorageActor is about to handle the request.
  void OnRequest(AgentId agent, const proto::Message& message);
  // An actor of it is about to handle the reply. What is stored, and was not seen before.
  std::vector<std::pair<RecordKey, proto::Record>> OnReply(AgentId agent, const proto::Message& message);
  // Nothing that was asked there is answered any more. True: something was.
  bool Forget(AgentId agent);

 private:
  std::map<std::pair<AgentId, std::uint64_t>, proto::InsertRequest> asked_;  // By request id.
};

}  // namespace moondb::simulation
