// PeerConnection: the sockets of the connection to one peer, and when they are made anew.
//
// A DEALER and its monitor live for one connection: when that breaks they are closed, with all that libzmq and the
// kernel still hold for it, and made anew 100 ms later; after each connection over which nothing was heard the delay
// doubles, up to 30 s. Until a connection stands libzmq tries again and again by itself, from 100 ms to 4 s apart.
//
// Its owner guards it.
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
    std::optional<CurveKeys> own_keys;  // None: without CURVE.
    std::string peer_key;               // Public.
    std::size_t frame_bytes_max = 0;
  };

  // Both outlive it.
  PeerConnection(const ZmqContext& context, const Options& options) : context_(context), options_(options) {}

  // Closes what there is and begins to connect. kUnavailable if sockets cannot be made; they are tried again in 30 s.
  Result<void> Connect(MonotonicTime now);
  // Closes the sockets, to be made anew after the delay.
  void Disconnect(MonotonicTime now);
  // Closes the sockets. Connect is due in 30 s, even if the peer is heard before.
  void DisconnectForLong(MonotonicTime now);
  // The peer was heard: the delay begins small again, and sockets that wait for it are made now. `is_at_once`: those
  // with which libzmq waits to try again too.
  void OnHeard(MonotonicTime now, bool is_at_once);

  // When Connect is due; nothing while sockets are there.
  std::optional<MonotonicTime> connect_at() const { return connect_at_; }

  // The handshake has ended well: nothing is known yet of what the socket has room for.
  void OnOpened() { is_full_ = false; }
  // Returns the next event of the monitor, if there is one.
  std::optional<ZmqEvent> ReceiveEvent() { return monitor_ ? monitor_->ReceiveEvent() : std::nullopt; }
  // The socket's file has news.
  void OnReadable();

  // Sends a proto::PeerFrame with this link number and these messages (ToPeerFrame). Returns false if the socket is
  // full, until its file has news.
  bool Send(std::uint32_t link_number, const std::string& messages);
  bool is_full() const { return is_full_; }

  int socket_file() const { return dealer_ ? dealer_->file() : -1; }  // -1: none now.
  int monitor_file() const { return monitor_ ? monitor_->file() : -1; }

 private:
  const ZmqContext& context_;
  const Options& options_;
  std::optional<ZmqSocket> monitor_;
  std::optional<ZmqSocket> dealer_;
  std::uint64_t begun_ = 0;  // Connections so far; names the monitors.
  std::optional<MonotonicTime> connect_at_;
  Duration delay_{};            // Grows while nothing is heard.
  MonotonicTime not_before_{};  // Connect is not due earlier.
  bool is_full_ = false;
};

}  // namespace moondb
