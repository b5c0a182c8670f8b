#include "runtime/envelope.h"

namespace moondb {

void WriteEnvelope(const Address& from, const Address& to, proto::Message& message) {
  WriteLocalEnvelope(from.agent, to.agent, message);
  message.set_source_actor(from.actor);
  message.set_destination_actor(to.actor);
}

void WriteLocalEnvelope(AgentId from, AgentId to, proto::Message& message) {
  message.set_hop_sender(from);
  message.set_destination_id(to);
  if (message.agent_id() == 0) message.set_agent_id(from);
}

bool IsFromLocalClient(const proto::Message& message) {
  return message.hop_sender() == kClients && message.client_name().empty() &&
         message.client_rights() == proto::CLIENT_RIGHTS_COMMAND;
}

Address SenderOf(const proto::Message& message) { return {message.hop_sender(), message.source_actor()}; }

}  // namespace moondb
