#include "runtime/envelope.h"

namespace moondb {

void WriteEnvelope(const Address& from, const Address& to, proto::Message& message) {
  message.set_hop_sender(from.agent);
  message.set_source_actor(from.actor);
  message.set_destination_id(to.agent);
  message.set_destination_actor(to.actor);
  if (message.agent_id() == 0) message.set_agent_id(from.agent);
}

Address SenderOf(const proto::Message& message) { return {message.hop_sender(), message.source_actor()}; }

}  // namespace moondb
