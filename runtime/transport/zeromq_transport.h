// ZeroMqTransport: implements Transport with ZeroMQ. One thread owns all sockets of an agent.
//
// Between agents, one socket only receives, and one DEALER per peer only sends (runtime/transport/peer_link.h). A ZAP
// handler admits only the CURVE keys of the team file. A frame is counted and dropped if its hop_sender is not the
// agent of the key, or if its body is internal to one agent. Clients use separate ROUTERs
// (runtime/transport/client_listener.h).
//
// Bytes in flight are limited by a credit per connection (runtime/transport/link_credit.h), because libzmq would queue
// for absent peers and buffer megabytes for frozen ones. Deadlines detect silent peers
// (runtime/transport/link_health.h). ConnectionLimiter cuts connections that exceed their limits.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "model/error.h"
#include "proto/team.pb.h"
#include "runtime/transport.h"
#include "runtime/transport/link_credit.h"
#include "runtime/transport/link_health.h"
#include "runtime/transport/outbox.h"

namespace moondb {

namespace proto {
class ListenerStatus;
}

class ZeroMqTransport final : public Transport {
 public:
  struct Options {
    AgentId self = 0;
    std::string client_endpoint;  // ipc://...; empty: no clients over ipc.
    // Size limits. Larger frames are not sent; receiving a larger frame closes the connection. For requests over
    // tcp://, the limit is at most kKeyedRequestBytesMax.
    std::size_t frame_bytes_max = kPeerFrameBytesMax;         // Limit of a frame between agents.
    std::size_t client_message_bytes_max = 32 * 1024 * 1024;  // Limit of a request or reply.
    Outbox::Options outbox;                                   // Limits per peer of messages that wait for credit.
    LinkCredit::Options credit;                               // Limits per peer of bytes in flight.
    LinkHealth::Options health;                               // Deadlines for silent peers.
    std::string secret_key_file;  // Empty: the file beside the public key, with the extension .sec.
    std::string clients_file;     // List of clients admitted at client_address (runtime/team/client_list.h).
  };

  // Binds the sockets and starts the thread. Both callbacks may run before Create returns. Requires: `team` passed
  // CheckTeam. Relative paths of key files start at `team_folder`.
  //
  // Returns kUnavailable if an address is in use. Returns kInvalid if a key file is missing, malformed or does not
  // match the team file, or if a secret key file is readable by others. Also returns kInvalid if the folder of
  // client_endpoint is not private to this user; a missing folder is created. An invalid clients_file is logged, and
  // admits no clients until it is fixed.
  static Result<std::unique_ptr<ZeroMqTransport>> Create(const proto::TeamConfig& team, const std::string& team_folder,
                                                         Options options, Deliver deliver, PeerChanged peer_changed);
  ~ZeroMqTransport() override;  // Joins the thread and drops the messages in outboxes.

  // Sends a message. Fails a Check for a link_report, which only transports send.
  [[nodiscard]] SendResult Send(const Address& to, const proto::Message& message) override;
  std::vector<proto::PeerStatus> Peers() const override;
  // Returns the bytes of replies that the clients with the key of this connection have not acknowledged
  // (ClientListener::UnreadBytes). Thread-safe.
  std::uint64_t UnreadReplyBytes(const std::string& connection) const;
  // Counters of refused handshakes and cut connections. Thread-safe.
  proto::ListenerStatus Listener() const;

 private:
  class Impl;
  explicit ZeroMqTransport(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb
