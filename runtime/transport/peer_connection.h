// PeerConnection: owns the sockets of the connection to one peer, and computes when to reconnect.
//
// Each connection has its own DEALER and monitor. When the connection breaks, Disconnect closes both sockets, which
// drops all data that libzmq and the kernel still hold for the connection. Connect is due 100 ms later. After each
// connection during which the peer was not heard, the delay doubles, up to 30 s. Until a connection is established,
// libzmq retries by itself, every 100 ms to 4 s.
//
// Not thread-safe: the caller provides the locking.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "runtime/actor.h"
#include "runtime/team/curve_keys.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb {

class PeerConnection {
 public:
  struct Options {
    AgentId self = 0;
    AgentId peer = 0;
    std::string address;
    std::optional<CurveKeys> own_keys;  // Empty: no CURVE.
    std::string peer_key;               // The peer's public key.
    std::size_t frame_bytes_max = 0;
  };

  // Requires: `context` and `options` outlive the connection.
  PeerConnection(const ZmqContext& context, const Options& options) : context_(context), options_(options) {}

  // Closes existing sockets and starts to connect. Returns kUnavailable if sockets cannot be created; Connect is then
  // due again in 30 s.
  Result<void> Connect(MonotonicTime now);
  // Closes the sockets. Connect is then due after the reconnection delay.
  void Disconnect(MonotonicTime now);
  // Closes the sockets. Connect is due in 30 s, even if the peer is heard earlier.
  void DisconnectForLong(MonotonicTime now);
  // Call when the peer was heard. Resets the delay, and makes Connect due now if there are no sockets. With
  // `is_at_once`, Connect is due now even if sockets exist, because libzmq may be waiting to retry.
  void OnHeard(MonotonicTime now, bool is_at_once);

  // Time at which Connect is due. Empty while sockets exist, unless OnHeard made Connect due.
  std::optional<MonotonicTime> connect_at() const { return connect_at_; }

  // Call when the handshake succeeded. Sets is_full() to false.
  void OnOpened() { is_full_ = false; }
  // Returns the next event of the monitor, or nothing if none waits.
  std::optional<ZmqEvent> ReceiveEvent() { return monitor_ ? monitor_->ReceiveEvent() : std::nullopt; }
  // Call when the socket's descriptor is readable.
  void OnReadable();

  // Sends a proto::PeerFrame with this link number. `messages` is a result of ToPeerFrame, or several results
  // concatenated. Returns false if the socket is full. The socket may have room again after OnReadable. Requires: the
  // sockets exist.
  bool Send(std::uint32_t link_number, const std::string& messages);
  bool is_full() const { return is_full_; }

  int socket_file() const { return dealer_ ? dealer_->file() : -1; }  // -1: no socket exists.
  int monitor_file() const { return monitor_ ? monitor_->file() : -1; }

 private:
  const ZmqContext& context_;
  const Options& options_;
  std::optional<ZmqSocket> monitor_;
  std::optional<ZmqSocket> dealer_;
  std::uint64_t begun_ = 0;  // Number of monitors created so far. Makes the names of their endpoints unique.
  std::optional<MonotonicTime> connect_at_;
  Duration delay_{};            // Delay before the next reconnection. Grows while the peer is not heard.
  MonotonicTime not_before_{};  // Earliest time at which Connect may be due.
  bool is_full_ = false;
};

}  // namespace moondb
