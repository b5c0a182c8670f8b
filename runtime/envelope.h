// Functions that write the addresses of a message when it is sent, and read its sender when it is handled. Used for
// local, remote and client messages.
#pragma once

#include "proto/message.pb.h"
#include "runtime/address.h"

namespace moondb {

// Sets hop_sender, source_actor, destination_id and destination_actor. If agent_id is 0, sets it to from.agent, as the
// origin of the data. Requires: `to` is not an alias.
void WriteEnvelope(const Address& from, const Address& to, proto::Message& message);

// Sets hop_sender and destination_id, and agent_id if it is 0. For messages within one agent, which do not carry the
// actors' names.
void WriteLocalEnvelope(AgentId from, AgentId to, proto::Message& message);

// Returns the sender of the last hop: hop_sender and source_actor.
Address SenderOf(const proto::Message& message);

}  // namespace moondb
