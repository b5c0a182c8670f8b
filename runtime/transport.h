// Transport: carries Messages between agents, and between an agent and its clients.
//
// The delivery guarantee is weak on purpose. An accepted message may be lost, duplicated or delayed. It is never
// damaged and never from an agent other than hop_sender. Reliable delivery is the task of the layer above, which
// retransmits (actors/sharing).
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "runtime/actor.h"

namespace moondb::proto {
class PeerStatus;
}  // namespace moondb::proto

namespace moondb {

// Largest frame between agents, which a 1 Mbps radio sends in two seconds. Senders split larger data into pages or
// fragments, or their send is refused with kTooLong. Receiving a larger frame closes the connection.
inline constexpr std::size_t kPeerFrameBytesMax = 256 * 1024;
// Largest serialised message that fits into a frame of kPeerFrameBytesMax.
inline constexpr std::size_t kPeerMessageBytesMax = kPeerFrameBytesMax - 11;

class Transport {
 public:
  // Receives an incoming message. hop_sender is authenticated. For clients, hop_sender is kClients and source_actor
  // names the connection. Called on the transport's thread; must not block.
  using Deliver = std::function<void(OwnedMessage)>;
  // Called when a peer connects or disconnects, on the transport's thread.
  using PeerChanged = std::function<void(AgentId peer, bool is_connected)>;

  virtual ~Transport() = default;

  // Sends to an agent or to kClients. Never blocks. Thread-safe.
  [[nodiscard]] virtual SendResult Send(const Address& to, const proto::Message& message) = 0;
  virtual std::vector<proto::PeerStatus> Peers() const = 0;
};

}  // namespace moondb
