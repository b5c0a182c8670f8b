#include "runtime/transport/peer_connection.h"

#include <zmq.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

#include "runtime/transport/outbound.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// High-water mark in messages. LinkCredit limits the bytes in libzmq, so even small frames never reach this mark.
constexpr int kSendQueueMessages = 2000;
constexpr int kReconnectFirst_ms = 100;
constexpr int kReconnectLast_ms = 4000;
constexpr int kConnectTimeout_ms = 5000;
// libzmq closes a connection if the peer's kernel acknowledges no data for this long. This adds no traffic to an idle
// link.
constexpr int kUnacknowledgedMax_ms = 15000;
constexpr Duration kDelayFirst = milliseconds(100);
constexpr Duration kDelayLast = seconds(30);

constexpr int kEvents = ZMQ_EVENT_CONNECTED | ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_DISCONNECTED |
                        ZMQ_EVENT_HANDSHAKE_FAILED_AUTH | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL;

void SetUp(const PeerConnection::Options& options, ZmqSocket* dealer) {
  dealer->Set(ZMQ_IMMEDIATE, 1);
  dealer->Set(ZMQ_SNDHWM, kSendQueueMessages);
  dealer->Set(ZMQ_RCVHWM, 1);  // Nothing is received on this socket.
  dealer->Set(ZMQ_RECONNECT_IVL, kReconnectFirst_ms);
  dealer->Set(ZMQ_RECONNECT_IVL_MAX, kReconnectLast_ms);
  dealer->Set(ZMQ_CONNECT_TIMEOUT, kConnectTimeout_ms);
  dealer->Set(ZMQ_TCP_MAXRT, kUnacknowledgedMax_ms);
  dealer->SetInt64(ZMQ_MAXMSGSIZE, static_cast<std::int64_t>(options.frame_bytes_max));
  if (options.address.find('[') != std::string::npos) dealer->Set(ZMQ_IPV6, 1);
  // Without CURVE, the routing id identifies this agent to the peer's ROUTER. A new connection replaces an earlier one
  // with the same id that the ROUTER still considers open.
  if (!options.own_keys) return dealer->Set(ZMQ_ROUTING_ID, std::to_string(options.self));
  dealer->Set(ZMQ_CURVE_SERVERKEY, options.peer_key);
  dealer->Set(ZMQ_CURVE_PUBLICKEY, options.own_keys->public_key);
  dealer->Set(ZMQ_CURVE_SECRETKEY, options.own_keys->secret_key);
}

}  // namespace

Result<void> PeerConnection::Connect(MonotonicTime now) {
  dealer_.reset();
  monitor_.reset();
  connect_at_ = now + kDelayLast;  // Time of the next attempt, in case no sockets can be created now.
  Result<ZmqSocket> dealer = ZmqSocket::Make(context_, ZMQ_DEALER);
  if (!dealer) return tl::unexpected(dealer.error());
  SetUp(options_, &*dealer);
  Result<ZmqSocket> monitor = dealer->MakeMonitor(
      context_, "inproc://monitor-" + std::to_string(options_.peer) + "-" + std::to_string(++begun_), kEvents);
  if (!monitor) return tl::unexpected(monitor.error());
  if (const auto begun = dealer->Connect(options_.address); !begun) return tl::unexpected(begun.error());
  dealer_ = std::move(*dealer);
  monitor_ = std::move(*monitor);
  connect_at_.reset();
  return {};
}

void PeerConnection::Disconnect(MonotonicTime now) {
  dealer_.reset();
  monitor_.reset();
  delay_ = std::clamp(delay_, kDelayFirst, kDelayLast);
  connect_at_ = now + delay_;
  delay_ *= 2;
}

void PeerConnection::DisconnectForLong(MonotonicTime now) {
  Disconnect(now);
  not_before_ = now + kDelayLast;
  connect_at_ = not_before_;
}

void PeerConnection::OnHeard(MonotonicTime now, bool is_at_once) {
  delay_ = kDelayFirst;
  if (!dealer_ || is_at_once) connect_at_ = std::max(now, not_before_);
}

void PeerConnection::OnReadable() {
  if (dealer_) dealer_->Process();
  is_full_ = false;
}

bool PeerConnection::Send(std::uint32_t link_number, const std::string& messages) {
  ZmqFrame frame(kLinkNumberBytes + messages.size());
  WriteLinkNumber(link_number, frame.data());
  std::memcpy(frame.data() + kLinkNumberBytes, messages.data(), messages.size());
  is_full_ = dealer_->Send(&frame) != ZmqSend::kSent;
  return !is_full_;
}

}  // namespace moondb
