// PeerLink: the way to one peer: a DEALER that only sends, its outbox, and what is counted about the peer.
//
// Lives on the transport's thread, but for Send and Status. libzmq connects by itself, again and again, from 100 ms to
// 2 s apart; the link counts as connected from the end of the handshake on, in which CURVE has shown that the other end
// holds the peer's secret key.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "proto/control.pb.h"
#include "runtime/curve_keys.h"
#include "runtime/outbox.h"
#include "runtime/rate_limited_log.h"
#include "runtime/transport.h"
#include "runtime/zmq_socket.h"

namespace moondb {

class PeerLink {
 public:
  struct Options {
    AgentId self = 0;
    AgentId peer = 0;
    std::string name;
    std::string address;
    std::optional<CurveKeys> own_keys;  // None: without CURVE.
    std::string peer_key;               // Public.
    std::size_t message_bytes_max = 0;
    std::size_t outbox_bytes_max = 0;
  };

  // Begins to connect. kUnavailable if sockets cannot be made.
  static Result<std::unique_ptr<PeerLink>> Make(const ZmqContext& context, Options options);

  // Any thread. A message too large for the peer is kFull.
  SendResult Send(const proto::Message& message);
  // Any thread.
  proto::PeerStatus Status() const;

  // Hears what became of the connection; tells each change.
  void OnMonitorReadable(const Transport::PeerChanged& peer_changed);
  // Hands over what the socket takes now.
  void Flush();
  // Something is left: call Flush when the socket can be written to.
  bool is_waiting() const { return !outbox_.empty(); }

  void CountReceived(std::size_t frame_bytes);
  void CountRejected() { ++rejected_messages_; }

  void* socket() const { return dealer_.get(); }
  void* monitor() const { return monitor_.get(); }
  const std::string& name() const { return options_.name; }

 private:
  PeerLink(Options options, ZmqSocket dealer, ZmqSocket monitor);
  void OnEvent(int event, const Transport::PeerChanged& peer_changed);

  Options options_;
  ZmqSocket monitor_;
  ZmqSocket dealer_;
  Outbox outbox_;
  RateLimitedLog log_;
  std::atomic<std::int64_t> heard_ns_{-1};  // Of the steady clock; negative: never.
  std::atomic<std::uint64_t> sent_messages_{0};
  std::atomic<std::uint64_t> sent_bytes_{0};
  std::atomic<std::uint64_t> received_messages_{0};
  std::atomic<std::uint64_t> received_bytes_{0};
  std::atomic<std::uint64_t> dropped_messages_{0};
  std::atomic<std::uint64_t> rejected_messages_{0};
};

}  // namespace moondb
