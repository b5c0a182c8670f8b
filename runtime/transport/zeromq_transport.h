// ZeroMqTransport: one thread that owns every socket of an agent.
//
// Between agents: a bound DEALER that only receives, one DEALER per peer that only sends
// (runtime/transport/peer_link.h); CURVE on all of them, and a ZAP handler that admits the team file's keys alone and
// binds each to its agent, whatever the connection says of itself: a frame whose hop_sender is not the key's agent is
// counted and dropped, and so is a body that only actors of one agent send each other. A frame between agents is a
// proto::PeerFrame: small messages that come one upon the other share one. Clients talk to ROUTERs of their own
// (runtime/transport/client_listener.h), request and reply, a proto::Message a frame.
//
// libzmq would queue silently for absent peers and let megabytes in for frozen ones, so queues are bounded here: byte
// credit per connection, ZMQ_IMMEDIATE, LINGER 0; peers that fall silent are noticed by deadlines, without ZMTP's
// heartbeat. ConnectionLimiter cuts connections that take too much. The thread sleeps until a socket, a sender or a
// deadline wakes it.
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
    std::string client_endpoint;  // ipc://..., empty: no clients over ipc.
    // Larger frames close the connection, and are not sent. From a client with a key kKeyedRequestBytesMax at most.
    std::size_t frame_bytes_max = kPeerFrameBytesMax;         // Between agents.
    std::size_t client_message_bytes_max = 32 * 1024 * 1024;  // Of a request or a reply.
    Outbox::Options outbox;                                   // Per peer, waiting for credit.
    LinkCredit::Options credit;                               // Per peer, under way.
    LinkHealth::Options health;                               // When a silent peer is asked, and given up.
    std::string secret_key_file;                              // Empty: beside the public key, with the ending .sec.
    std::string clients_file;  // Whom the team file's client_address lets in (runtime/team/client_list.h).
  };

  // Binds and starts: both callbacks may come before this returns, so that they have to wait until there is somebody to
  // tell. `team` is checked; `team_folder` is where relative key files lie. Errors: kUnavailable for an address in use,
  // kInvalid for a key file that is missing, malformed, readable by others (secret) or does not fit the public key in
  // the team file, and for a folder of client_endpoint that is not this user's alone (it is made if it is missing). A
  // clients_file that is wrong lets nobody in until it is mended, and is logged.
  static Result<std::unique_ptr<ZeroMqTransport>> Create(const proto::TeamConfig& team, const std::string& team_folder,
                                                         Options options, Deliver deliver, PeerChanged peer_changed);
  ~ZeroMqTransport() override;  // Joins the thread; what waits in outboxes is dropped.

  // A link_report is the transport's own word: to send one is a mistake in the program.
  [[nodiscard]] SendResult Send(const Address& to, const proto::Message& message) override;
  std::vector<proto::PeerStatus> Peers() const override;
  // What was refused before it was a message. Any thread.
  proto::ListenerStatus Listener() const;

 private:
  class Impl;
  explicit ZeroMqTransport(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb
