// Transport: carries Messages between agents, and between an agent and its clients.
//
// A weak contract on purpose: a message that was accepted may be lost, repeated or come late, but not damaged and not
// from another agent than hop_sender says. Whatever must arrive is sent again by whoever wants it to (actors/sharing).
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

// A frame between agents has so many bytes at most, two seconds of a 1 Mbps radio. What is longer is cut into pages or
// pieces by whoever sends it, or refused there with kTooLong: one that came in would close the connection.
inline constexpr std::size_t kPeerFrameBytesMax = 256 * 1024;
// Of a message that has a frame of its own, serialised.
inline constexpr std::size_t kPeerMessageBytesMax = kPeerFrameBytesMax - 11;

class Transport {
 public:
  // Takes a message that came in (hop_sender is checked; from clients it is kClients and source_actor names the
  // connection). Called on the transport's thread; must not block.
  using Deliver = std::function<void(OwnedMessage)>;
  // A peer was reached or lost. Called on the transport's thread.
  using PeerChanged = std::function<void(AgentId peer, bool is_connected)>;

  virtual ~Transport() = default;

  // Any thread; never blocks. `to` is an agent or kClients.
  [[nodiscard]] virtual SendResult Send(const Address& to, const proto::Message& message) = 0;
  virtual std::vector<proto::PeerStatus> Peers() const = 0;
};

}  // namespace moondb
