// Transport: carries Messages between agents, and between an agent and its clients.
//
// An accepted message may be lost, duplicated or delayed. It is never damaged and never from an agent other than
// hop_sender. The layer above (actors/sharing) retransmits what must arrive.
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

// Maximum size of a frame between agents. A 1 Mbps radio sends such a frame in two seconds. Senders split larger data
// into pages or fragments; otherwise their send is refused with kTooLong. Receiving a larger frame closes the
// connection.
inline constexpr std::size_t kPeerFrameBytesMax = 256 * 1024;
// Largest serialised message that fits into a frame of kPeerFrameBytesMax.
inline constexpr std::size_t kPeerMessageBytesMax = kPeerFrameBytesMax - 11;

class Transport {
 public:
  // Called for each incoming message, on the transport's thread. Must not block. hop_sender is authenticated. For
  // clients, hop_sender is kClients and source_actor names the connection.
  using Deliver = std::function<void(OwnedMessage)>;
  // Called when a peer connects or disconnects, on the transport's thread.
  using PeerChanged = std::function<void(AgentId peer, bool is_connected)>;

  virtual ~Transport() = default;

  // Sends `message` to an agent, or to a client if to.agent is kClients. Never blocks. Thread-safe.
  [[nodiscard]] virtual SendResult Send(const Address& to, const proto::Message& message) = 0;
  virtual std::vector<proto::PeerStatus> Peers() const = 0;
};

}  // namespace moondb
