// The door: what comes in from peers and clients is parsed and checked here, once; behind it, it is trusted.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "runtime/transport.h"

namespace moondb {

// Removes the link number from the front of a proto::PeerFrame, and returns it. Returns none, and leaves the frame, if
// it does not begin with one, or with 0.
std::optional<std::uint32_t> TakeLinkNumber(std::string_view* frame);

// The rest of a proto::PeerFrame; all of its messages, which one agent sent, or none. Several share only a frame of at
// most kSharedFrameBytesMax. `authenticated`: the agent whose key the connection has; none without CURVE, where the
// claim has to do. kCorrupt: does not decode. kRefused: claims another hop_sender than the authenticated one, or is a
// message that only actors of one agent send each other (timers, storage's own). A peer's word for a client's rights is
// not heard.
Result<std::vector<OwnedMessage>> ParsePeerFrame(std::string_view frame, std::optional<AgentId> authenticated);

// Who a client is, as its agent's door knows it.
struct ClientIdentity {
  proto::ClientRights rights = proto::CLIENT_RIGHTS_NONE;
  std::string name;  // As its key is listed; empty: it came over ipc.
};

// Addressed to the gateway of `self`, from {kClients, connection}, with the rights and name of `client`, whatever the
// client wrote there; its agent_id, term, record_id and sql are not heard. Errors as above; kRefused for what
// transports say to each other, too.
Result<OwnedMessage> ParseClientFrame(std::string_view frame, const std::string& connection,
                                      const ClientIdentity& client, AgentId self);

}  // namespace moondb
