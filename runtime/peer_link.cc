#include "runtime/peer_link.h"

#include <spdlog/spdlog.h>
#include <zmq.h>

#include <chrono>
#include <cstring>
#include <utility>

namespace moondb {
namespace {

// What libzmq and the kernel may hold of a peer's messages is lost without an error when the connection breaks, so it
// is kept small (measured: HWM 4 and 16 kB lose 12 of 200 messages, the defaults 137).
constexpr int kSendQueueMessages = 4;
constexpr int kSocketBufferBytes = 16 * 1024;
constexpr int kReconnectFirst_ms = 100;
constexpr int kReconnectLast_ms = 2000;
constexpr int kConnectTimeout_ms = 5000;
// A peer whose kernel acknowledges nothing for so long is gone; costs nothing on an idle link.
constexpr int kUnacknowledgedMax_ms = 15000;
constexpr std::size_t kOutboxFramesMax = 4096;

constexpr int kEvents = ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH |
                        ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL;

std::int64_t SteadyNow_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void SetUp(const PeerLink::Options& options, ZmqSocket* dealer) {
  dealer->Set(ZMQ_IMMEDIATE, 1);
  dealer->Set(ZMQ_SNDHWM, kSendQueueMessages);
  dealer->Set(ZMQ_RCVHWM, 1);  // Nothing is to come this way.
  dealer->Set(ZMQ_SNDBUF, kSocketBufferBytes);
  dealer->Set(ZMQ_RCVBUF, kSocketBufferBytes);
  dealer->Set(ZMQ_RECONNECT_IVL, kReconnectFirst_ms);
  dealer->Set(ZMQ_RECONNECT_IVL_MAX, kReconnectLast_ms);
  dealer->Set(ZMQ_CONNECT_TIMEOUT, kConnectTimeout_ms);
  dealer->Set(ZMQ_TCP_MAXRT, kUnacknowledgedMax_ms);
  dealer->SetInt64(ZMQ_MAXMSGSIZE, static_cast<std::int64_t>(options.message_bytes_max));
  // The peer's ROUTER replaces a connection of ours that it has not yet seen die.
  dealer->Set(ZMQ_ROUTING_ID, std::to_string(options.self));
  if (options.address.find('[') != std::string::npos) dealer->Set(ZMQ_IPV6, 1);
  if (!options.own_keys) return;
  dealer->Set(ZMQ_CURVE_SERVERKEY, options.peer_key);
  dealer->Set(ZMQ_CURVE_PUBLICKEY, options.own_keys->public_key);
  dealer->Set(ZMQ_CURVE_SECRETKEY, options.own_keys->secret_key);
}

}  // namespace

Result<std::unique_ptr<PeerLink>> PeerLink::Make(const ZmqContext& context, Options options) {
  Result<ZmqSocket> dealer = ZmqSocket::Make(context, ZMQ_DEALER);
  if (!dealer) return tl::unexpected(dealer.error());
  SetUp(options, &*dealer);
  Result<ZmqSocket> monitor = ZmqSocket::Make(context, ZMQ_PAIR);
  if (!monitor) return tl::unexpected(monitor.error());
  const std::string endpoint = "inproc://monitor-" + std::to_string(options.peer);
  if (const auto watched = dealer->Monitor(endpoint, kEvents); !watched) return tl::unexpected(watched.error());
  if (const auto joined = monitor->Connect(endpoint); !joined) return tl::unexpected(joined.error());
  if (const auto begun = dealer->Connect(options.address); !begun) return tl::unexpected(begun.error());
  return std::unique_ptr<PeerLink>(new PeerLink(std::move(options), std::move(*dealer), std::move(*monitor)));
}

PeerLink::PeerLink(Options options, ZmqSocket dealer, ZmqSocket monitor)
    : options_(std::move(options)),
      monitor_(std::move(monitor)),
      dealer_(std::move(dealer)),
      outbox_(options_.outbox_bytes_max, kOutboxFramesMax, /*is_open=*/false) {}

SendResult PeerLink::Send(const proto::Message& message) {
  SendResult result = SendResult::kUnreachable;
  if (outbox_.is_open()) {
    const std::size_t bytes = message.ByteSizeLong();
    result = bytes > options_.message_bytes_max ? SendResult::kFull : outbox_.Push({"", message.SerializeAsString()});
  }
  if (result != SendResult::kAccepted) ++dropped_messages_;
  return result;
}

proto::PeerStatus PeerLink::Status() const {
  const std::int64_t heard_ns = heard_ns_;
  proto::PeerStatus status;
  status.set_agent_id(options_.peer);
  status.set_name(options_.name);
  status.set_is_connected(outbox_.is_open());
  status.set_seconds_since_heard(heard_ns < 0 ? -1.0 : static_cast<double>(SteadyNow_ns() - heard_ns) * 1e-9);
  status.set_sent_messages(static_cast<double>(sent_messages_));
  status.set_sent_bytes(static_cast<double>(sent_bytes_));
  status.set_received_messages(static_cast<double>(received_messages_));
  status.set_received_bytes(static_cast<double>(received_bytes_));
  status.set_dropped_messages(static_cast<double>(dropped_messages_));
  status.set_rejected_messages(static_cast<double>(rejected_messages_));
  return status;
}

void PeerLink::OnMonitorReadable(const Transport::PeerChanged& peer_changed) {
  bool has_changed = false;
  for (ZmqParts parts; monitor_.Receive(&parts); has_changed = true) {
    std::uint16_t event = 0;
    if (parts.parts.empty() || parts.parts[0].size() < sizeof event) continue;
    std::memcpy(&event, parts.parts[0].data(), sizeof event);
    OnEvent(event, peer_changed);
  }
  // A socket that is only written to would otherwise pile up the commands of connections that came and went.
  if (has_changed) dealer_.Process();
}

void PeerLink::OnEvent(int event, const Transport::PeerChanged& peer_changed) {
  switch (event) {
    case ZMQ_EVENT_HANDSHAKE_SUCCEEDED:
      if (outbox_.is_open()) return;
      outbox_.Open();
      spdlog::info("transport: {} is connected", options_.name);
      peer_changed(options_.peer, true);
      return;
    case ZMQ_EVENT_DISCONNECTED:
      if (!outbox_.is_open()) return;
      dropped_messages_ += outbox_.Close();
      spdlog::info("transport: {} is lost", options_.name);
      peer_changed(options_.peer, false);
      return;
    default:
      log_.Warn("transport: " + options_.name + " at " + options_.address +
                " does not take our key, or does not hold the one of the team file");
  }
}

void PeerLink::Flush() {
  while (const Outbox::Entry* entry = outbox_.Front()) {
    if (dealer_.Send({&entry->frame}) != ZmqSend::kSent) return;
    ++sent_messages_;
    sent_bytes_ += entry->frame.size();
    outbox_.PopFront();
  }
}

void PeerLink::CountReceived(std::size_t frame_bytes) {
  heard_ns_ = SteadyNow_ns();
  ++received_messages_;
  received_bytes_ += frame_bytes;
}

}  // namespace moondb
