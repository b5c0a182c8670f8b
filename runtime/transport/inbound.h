// Parses and validates all messages from peers and clients. All other code trusts the messages that these functions
// return.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "runtime/transport.h"

namespace moondb {

// Removes and returns the link number at the front of a proto::PeerFrame. If the frame has no link number, or the
// number is 0, returns nothing and leaves the frame unchanged.
std::optional<std::uint32_t> TakeLinkNumber(std::string_view* frame);

// Parses a proto::PeerFrame from which TakeLinkNumber has removed the link number. Returns all messages of the frame,
// with client rights and names cleared. `authenticated`: the agent whose key the connection uses; empty without CURVE,
// and then hop_sender is not verified.
//
// Returns kCorrupt if the frame does not decode, holds several messages but exceeds kSharedFrameBytesMax, or holds a
// link report among other messages. Returns kRefused if hop_sender is not `authenticated`, if the messages have
// different senders, or if a message is internal to one agent (such as a timer).
Result<std::vector<OwnedMessage>> ParsePeerFrame(std::string_view frame, std::optional<AgentId> authenticated);

// The verified identity of a client.
struct ClientIdentity {
  proto::ClientRights rights = proto::CLIENT_RIGHTS_NONE;
  std::string name;  // Name of the client's key in the list; empty for a client over ipc.
};

// Parses a message of `client`. Sets the destination to the gateway of `self`, the source to {kClients, connection},
// agent_id to `self`, and the client's rights and name to those of `client`. Clears term, record_id and sql. Returns
// kCorrupt if the frame does not decode, kRefused if the message is a link report or internal to one agent.
Result<OwnedMessage> ParseClientFrame(std::string_view frame, const std::string& connection,
                                      const ClientIdentity& client, AgentId self);

}  // namespace moondb
