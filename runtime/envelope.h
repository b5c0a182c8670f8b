// Functions that write the addresses of a message when it is sent, and read its sender when it is handled.
#pragma once

#include "proto/message.pb.h"
#include "runtime/address.h"

namespace moondb {

// Sets hop_sender, source_actor, destination_id and destination_actor. If agent_id is 0, sets it to from.agent, as the
// origin of the data. Requires: `to` is not an alias.
void WriteEnvelope(const Address& from, const Address& to, proto::Message& message);

// Writes the envelope like WriteEnvelope, without source_actor and destination_actor. For messages within one agent.
void WriteLocalEnvelope(AgentId from, AgentId to, proto::Message& message);

// Returns true if a client over ipc sent the message. Such a client belongs to the agent's own user. Clients with keys
// have a client_name; clients with unlisted keys have no rights.
bool IsFromLocalClient(const proto::Message& message);

// Returns the sender of the last hop: hop_sender and source_actor.
Address SenderOf(const proto::Message& message);

}  // namespace moondb
