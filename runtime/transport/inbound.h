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

// Removes and returns the link number at the front of a proto::PeerFrame. If there is none, or it is 0, returns nothing
// and leaves the frame unchanged.
std::optional<std::uint32_t> TakeLinkNumber(std::string_view* frame);

// Parses a proto::PeerFrame without its link number. Returns all of its messages, or an error. All must be from one
// agent, and only frames up to kSharedFrameBytesMax may hold several. `authenticated` is the agent whose key the
// connection uses. It is empty without CURVE; hop_sender is then not verified. Returns kCorrupt if the frame does not
// decode. Returns kRefused if hop_sender is not the authenticated agent, or if only actors of one agent may send the
// message to each other (timers, storage's messages). Client rights in the messages are cleared.
Result<std::vector<OwnedMessage>> ParsePeerFrame(std::string_view frame, std::optional<AgentId> authenticated);

// The identity of a client, as its agent has verified it.
struct ClientIdentity {
  proto::ClientRights rights = proto::CLIENT_RIGHTS_NONE;
  std::string name;  // Name of the client's key in the list; empty for a client over ipc.
};

// Parses a client's message and addresses it to the gateway of `self`, from {kClients, connection}. Rights and name are
// those of `client`, whatever the message contains; its agent_id, term, record_id and sql are overwritten or cleared.
// Errors as for ParsePeerFrame. Also returns kRefused for messages that only transports send to each other.
Result<OwnedMessage> ParseClientFrame(std::string_view frame, const std::string& connection,
                                      const ClientIdentity& client, AgentId self);

}  // namespace moondb
