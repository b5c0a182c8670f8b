#include "apps/moondb_sim/own_inserts.h"

#include <algorithm>

#include "model/error.h"

namespace moondb::simulation {

void OwnInserts::OnRequest(AgentId agent, const proto::Message& message) {
  if (message.request_id() == 0 || message.insert_request().is_local()) return;
  asked_[{agent, message.request_id()}] = message.insert_request();
}

std::vector<std::pair<RecordKey, proto::Record>> OwnInserts::OnReply(AgentId agent, const proto::Message& message) {
  std::vector<std::pair<RecordKey, proto::Record>> stored;
  const auto asked = asked_.find({agent, message.request_id()});
  if (asked == asked_.end()) return stored;
  const proto::InsertReply& reply = message.insert_reply();
  const int count = std::min(reply.keys_size(), asked->second.records_size());
  for (int i = 0; i < count && !IsError(reply.error()); ++i) {
    stored.emplace_back(FromProto(reply.keys(i)), asked->second.records(i));
  }
  asked_.erase(asked);
  return stored;
}

bool OwnInserts::Forget(AgentId agent) {
  return std::erase_if(asked_, [agent](const auto& entry) { return entry.first.first == agent; }) > 0;
}

}  // namespace moondb::simulation
