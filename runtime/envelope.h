// The addresses on a message: written when it is sent, read when it is handled. The same for every way that a message
// can take.
#pragma once

#include "proto/message.pb.h"
#include "runtime/address.h"

namespace moondb {

// Writes hop_sender, source_actor, destination_id and destination_actor; agent_id where it is 0 (`from` is then where
// the data originate). `to` holds no alias any more.
void WriteEnvelope(const Address& from, const Address& to, proto::Message& message);

// The same for a way within one agent, where the actors' names do not travel: hop_sender, destination_id, agent_id.
void WriteLocalEnvelope(AgentId from, AgentId to, proto::Message& message);

// Who handed the message over: hop_sender and source_actor.
Address SenderOf(const proto::Message& message);

}  // namespace moondb
