#include "runtime/transport/peer_link.h"

#include <spdlog/spdlog.h>
#include <zmq.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <utility>

#include "proto/status.pb.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// The credit bounds what waits in libzmq; its own mark must not be what does, however small the frames are.
constexpr int kSendQueueMessages = 2000;
constexpr int kReconnectFirst_ms = 100;
constexpr int kReconnectLast_ms = 4000;
constexpr int kConnectTimeout_ms = 5000;
// A peer whose kernel acknowledges nothing for so long is gone; costs nothing on an idle link.
constexpr int kUnacknowledgedMax_ms = 15000;
// A connection that breaks is made anew after the first delay; one over which nothing was heard after a longer one.
constexpr Duration kConnectDelayFirst = milliseconds(100);
constexpr Duration kConnectDelayLast = seconds(30);
// So many small messages without a pause between them go out each in a frame of its own.
constexpr int kSentAtOnce = 4;
constexpr Duration kBurstPause = std::chrono::microseconds(20);
// How long a small message in a burst waits for others to share its frame.
constexpr Duration kSharedFrameDelay = std::chrono::microseconds(100);
// A radio that brings less is as good as none. For how long one large frame may keep everything else silent.
constexpr std::uint64_t kBytesPerSecondMin = 16 * 1024;

constexpr int kEvents = ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH |
                        ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL;

MonotonicTime SteadyNow() { return std::chrono::steady_clock::now(); }

void SetUp(const PeerLink::Options& options, ZmqSocket* dealer) {
  dealer->Set(ZMQ_IMMEDIATE, 1);
  dealer->Set(ZMQ_SNDHWM, kSendQueueMessages);
  dealer->Set(ZMQ_RCVHWM, 1);  // Nothing is to come this way.
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

// To a counter that this thread alone writes.
void Add(std::atomic<std::uint64_t>& counter, std::uint64_t value) {
  counter.store(counter.load(std::memory_order_relaxed) + value, std::memory_order_relaxed);
}

Duration TimeFor(std::uint64_t bytes) { return seconds(bytes / kBytesPerSecondMin); }

}  // namespace

Result<std::unique_ptr<PeerLink>> PeerLink::Make(const ZmqContext& context, WakeUp& wake_up, Options options) {
  std::unique_ptr<PeerLink> link(new PeerLink(context, wake_up, std::move(options)));
  const std::lock_guard lock(link->mutex_);
  if (const auto begun = link->Connect(SteadyNow()); !begun) return tl::unexpected(begun.error());
  return link;
}

// Numbers of connections begin at random: a report to an earlier life of this agent fits none of this one's.
PeerLink::PeerLink(const ZmqContext& context, WakeUp& wake_up, Options options)
    : context_(context),
      wake_up_(wake_up),
      options_(std::move(options)),
      link_number_(std::random_device{}()),
      credit_(options_.credit),
      health_(options_.health),
      outbox_(options_.outbox) {}

Result<void> PeerLink::Connect(MonotonicTime now) {
  connect_at_ = now + kConnectDelayLast;  // If no sockets can be made now.
  Result<ZmqSocket> dealer = ZmqSocket::Make(context_, ZMQ_DEALER);
  if (!dealer) return tl::unexpected(dealer.error());
  SetUp(options_, &*dealer);
  Result<ZmqSocket> monitor = dealer->MakeMonitor(
      context_, "inproc://monitor-" + std::to_string(options_.peer) + "-" + std::to_string(++connections_begun_),
      kEvents);
  if (!monitor) return tl::unexpected(monitor.error());
  if (const auto begun = dealer->Connect(options_.address); !begun) return tl::unexpected(begun.error());
  dealer_ = std::move(*dealer);
  monitor_ = std::move(*monitor);
  connect_at_.reset();
  return {};
}

void PeerLink::Disconnect(MonotonicTime now) {
  dealer_.reset();
  monitor_.reset();
  if (is_open_.exchange(false)) {
    dropped_messages_ += outbox_.Clear();
    changes_.push_back(false);
  }
  connect_delay_ = std::clamp(connect_delay_, kConnectDelayFirst, kConnectDelayLast);
  connect_at_ = now + connect_delay_;
  connect_delay_ *= 2;
}

SendResult PeerLink::Send(const proto::Message& message) {
  Outbox::Entry entry;
  const bool is_small_enough = message.ByteSizeLong() <= options_.message_bytes_max - kPeerFrameBytesMore;
  if (is_open_ && is_small_enough) {
    entry.frame = ToPeerFrame(message);
    entry.outbound_class = OutboundClassOf(message);
    entry.key = ReplaceKeyOf(message);
  }
  const MonotonicTime now = SteadyNow();
  MonotonicTime due = MonotonicTime::max();
  {
    const std::lock_guard lock(mutex_);
    SendResult result = is_small_enough ? SendResult::kAccepted : SendResult::kFull;
    // It may have opened only just now, with the frame not made.
    if (!is_open_ || (is_small_enough && entry.frame.empty())) result = SendResult::kUnreachable;
    if (result == SendResult::kAccepted) result = SendOrKeep(now, std::move(entry));
    if (result != SendResult::kAccepted) {
      ++dropped_messages_;
      return result;
    }
    // The transport's thread knows from the first that waits when to look.
    if (outbox_.messages() > 1 && flush_at_ > now && credit_.HasRoomFor(outbox_.bytes())) return result;
    UpdateExpectation(now);
    due = Deadline();
  }
  wake_up_.RingFor(due);
  return SendResult::kAccepted;
}

// Without a detour through the outbox and the transport's thread, if it can be. Large frames are announced first, by
// that thread.
SendResult PeerLink::SendOrKeep(MonotonicTime now, Outbox::Entry&& entry) {
  const bool is_for_shared_frame = IsInBurst(now) && entry.frame.size() * 2 <= SharedFrameBytesMax();
  const bool is_first = outbox_.empty();
  if (is_first && !is_for_shared_frame && TrySend(now, entry)) return SendResult::kAccepted;
  outbox_.ShareFrames(SharedFrameBytesMax());
  const SendResult result = outbox_.Push(std::move(entry));
  if (is_first) flush_at_ = is_for_shared_frame ? now + kSharedFrameDelay : now;
  if (outbox_.bytes() >= SharedFrameBytesMax()) SendWaiting(now);
  return result;
}

bool PeerLink::TrySend(MonotonicTime now, const Outbox::Entry& entry) {
  const std::size_t bytes = entry.frame.size();
  if (is_opening_due_ || bytes > credit_.credit_bytes()) return false;
  if (credit_.HasRoomFor(bytes)) return SendFrame(now, entry);
  credit_.OnBlocked();
  return false;
}

// The credit says how fast the link is: 4 kB at first, which a 1 Mbps radio sends in 33 ms.
std::size_t PeerLink::SharedFrameBytesMax() const { return std::min(credit_.credit_bytes() / 8, kSharedFrameBytesMax); }

// Then it is worth the detour to let small messages share a frame.
bool PeerLink::IsInBurst(MonotonicTime now) {
  sent_in_a_row_ = now - last_sent_ < kBurstPause ? std::min(sent_in_a_row_ + 1, kSentAtOnce) : 0;
  last_sent_ = now;
  return sent_in_a_row_ >= kSentAtOnce;
}

proto::PeerStatus PeerLink::Status() const {
  proto::PeerStatus status;
  const std::int64_t heard_ns = heard_ns_;
  const std::int64_t now_ns = SteadyNow().time_since_epoch().count();
  status.set_agent_id(options_.peer);
  status.set_name(options_.name);
  status.set_seconds_since_heard(heard_ns < 0 ? -1.0 : static_cast<double>(now_ns - heard_ns) * 1e-9);
  status.set_received_messages(static_cast<double>(received_messages_));
  status.set_received_bytes(static_cast<double>(received_bytes_));
  status.set_rejected_messages(static_cast<double>(rejected_messages_));
  const std::lock_guard lock(mutex_);
  status.set_is_connected(is_open_);
  status.set_sent_messages(static_cast<double>(sent_messages_));
  status.set_sent_bytes(static_cast<double>(sent_bytes_));
  status.set_dropped_messages(static_cast<double>(dropped_messages_));
  status.set_queued_messages(static_cast<double>(outbox_.messages()));
  status.set_queued_bytes(static_cast<double>(outbox_.bytes()));
  status.set_unreported_bytes(static_cast<double>(is_open_ ? credit_.unreported_bytes() : 0));
  status.set_replaced_messages(static_cast<double>(outbox_.replaced()));
  status.set_connects(static_cast<double>(connects_));
  status.set_lost_by_deadline(static_cast<double>(lost_by_deadline_));
  status.set_sent_reports(static_cast<double>(sent_reports_));
  status.set_refused_reports(static_cast<double>(refused_reports_));
  return status;
}

void PeerLink::OnMessages(std::size_t count, std::size_t frame_bytes, bool is_on_link) {
  is_heard_ = true;
  heard_ns_ = SteadyNow().time_since_epoch().count();  // Before whoever gets the messages can ask.
  if (coming_bytes_.load(std::memory_order_relaxed) != 0) coming_bytes_ = 0;
  Add(received_messages_, count);
  Add(received_bytes_, frame_bytes);
  if (is_on_link) received_.OnReceived(frame_bytes);
}

void PeerLink::OnRejected(std::size_t frame_bytes, bool is_on_link) {
  Add(rejected_messages_, 1);
  if (is_on_link) received_.OnReceived(frame_bytes);
}

void PeerLink::OnReport(const proto::LinkReport& report, bool is_on_link) {
  is_heard_ = true;
  const std::lock_guard lock(mutex_);
  if (!is_on_link) {
    ++refused_reports_;
    return;
  }
  // Whoever reached us can be reached, and waits for our reports.
  if (received_.OnLink(report.link()) && !is_open_) is_hurried_ = true;
  if (report.report_after_bytes() != 0) received_.SetReportAfter(report.report_after_bytes());
  if (report.is_asking()) is_report_due_ = true;
  coming_bytes_ = std::min<std::uint64_t>(report.coming_bytes(), options_.message_bytes_max);
  if (report.reported_link() == 0 || !is_open_) return;
  const MonotonicTime now = SteadyNow();
  const std::uint64_t unreported_before = credit_.unreported_bytes();
  if (!credit_.OnReport(now, report.reported_link(), report.received_bytes())) {
    ++refused_reports_;
    return;
  }
  if (credit_.unreported_bytes() < unreported_before) health_.OnProgress(now);
}

void PeerLink::OnMonitorReadable() {
  const std::lock_guard lock(mutex_);
  while (monitor_) {
    const std::optional<int> event = monitor_->ReceiveEvent();
    if (!event) return;
    OnEvent(*event, SteadyNow());
  }
}

void PeerLink::OnSocketReadable() {
  const std::lock_guard lock(mutex_);
  if (dealer_) dealer_->Process();
  is_socket_full_ = false;
}

void PeerLink::OnEvent(int event, MonotonicTime now) {
  switch (event) {
    case ZMQ_EVENT_HANDSHAKE_SUCCEEDED:
      if (is_open_) return;
      is_open_ = true;
      ++connects_;
      link_number_ += link_number_ == UINT32_MAX ? 2 : 1;  // 0 means none.
      credit_.Open(link_number_);
      health_.OnOpened(now);
      is_opening_due_ = true;
      is_asking_ = false;
      large_frame_notice_ = {};
      is_socket_full_ = false;
      changes_.push_back(true);
      return;
    case ZMQ_EVENT_DISCONNECTED:
      // Before the handshake libzmq tries again by itself.
      if (is_open_) Disconnect(now);
      return;
    default:
      log_.Warn("transport: " + options_.name + " at " + options_.address +
                " does not take our key, or does not hold the one of the team file");
  }
}

void PeerLink::OnHeard(MonotonicTime now) {
  heard_ns_ = now.time_since_epoch().count();
  health_.OnHeard(now);
  connect_delay_ = kConnectDelayFirst;
  // Not yet made anew, or libzmq waits to try again.
  if (!dealer_ || is_hurried_) connect_at_ = now;
}

void PeerLink::CheckHealth(MonotonicTime now) {
  switch (health_.Check(now, Patience())) {
    case LinkHealth::Step::kNone:
      return;
    case LinkHealth::Step::kAsk:
      is_asking_ = true;
      return;
    case LinkHealth::Step::kStalled:
      if (!credit_.has_report()) {
        credit_.Renew();
        health_.OnProgress(now);
        return;
      }
      [[fallthrough]];
    case LinkHealth::Step::kLost:
      ++lost_by_deadline_;
      Disconnect(now);
      return;
  }
}

void PeerLink::Work(MonotonicTime now, const Transport::PeerChanged& peer_changed) {
  std::vector<bool> changes;
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(is_heard_, false)) OnHeard(now);
    if (connect_at_ && now >= *connect_at_) {
      dealer_.reset();
      monitor_.reset();
      if (const auto begun = Connect(now); !begun) log_.Warn("transport: " + ToString(begun.error()));
    }
    is_hurried_ = false;
    if (is_open_) CheckHealth(now);
    if (is_open_) Flush(now);
    changes.swap(changes_);
  }
  for (const bool is_connected : changes) {
    spdlog::info("transport: {} is {}", options_.name, is_connected ? "connected" : "lost");
    peer_changed(options_.peer, is_connected);
  }
}

MonotonicTime PeerLink::deadline() const {
  const std::lock_guard lock(mutex_);
  return Deadline();
}

MonotonicTime PeerLink::Deadline() const {
  if (connect_at_) return *connect_at_;
  if (!is_open_) return MonotonicTime::max();
  if (!is_socket_full_ && HasReportDue()) return MonotonicTime::min();
  const MonotonicTime health_at = health_.deadline(Patience());
  return CanSendWaiting() ? std::min(flush_at_, health_at) : health_at;
}

bool PeerLink::HasReportDue() const {
  return is_opening_due_ || is_asking_ || is_report_due_ || told_credit_bytes_ != credit_.credit_bytes();
}

bool PeerLink::CanSendWaiting() const {
  return !is_socket_full_ && !outbox_.empty() && credit_.HasRoomFor(outbox_.Front()->frame.size());
}

void PeerLink::Flush(MonotonicTime now) {
  if (HasReportDue() || received_.is_report_due()) {
    is_report_due_ = true;  // If it cannot go out now.
    if (!SendReport(0)) return;
  }
  if (now >= flush_at_) SendWaiting(now);
  while (const Outbox::Entry* front = outbox_.Front()) {
    const std::size_t bytes = front->frame.size();
    if (bytes <= credit_.credit_bytes() || !credit_.HasRoomFor(bytes)) break;
    if (!large_frame_notice_.Covers(bytes) && !SendReport(bytes)) break;
    if (!SendFrame(now, *front)) break;
    outbox_.PopFront();
    SendWaiting(now);
  }
  UpdateExpectation(now);
}

// As far as the credit goes, and up to a large frame.
void PeerLink::SendWaiting(MonotonicTime now) {
  while (const Outbox::Entry* front = outbox_.Front()) {
    const std::size_t bytes = front->frame.size();
    if (!credit_.HasRoomFor(bytes)) return credit_.OnBlocked();
    if (is_opening_due_ || bytes > credit_.credit_bytes() || !SendFrame(now, *front)) return;
    outbox_.PopFront();
  }
}

bool PeerLink::SendReport(std::uint64_t coming_bytes) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_hop_sender(options_.self);
  proto::LinkReport& report = *message.mutable_link_report();
  report.set_link(credit_.link());
  report.set_reported_link(received_.link());
  report.set_received_bytes(received_.received_bytes());
  report.set_is_asking(is_asking_);
  const std::size_t credit_bytes = credit_.credit_bytes();
  if (is_opening_due_ || told_credit_bytes_ != credit_bytes) {
    report.set_report_after_bytes(static_cast<std::uint32_t>(std::max<std::size_t>(credit_bytes / 4, 1)));
  }
  report.set_coming_bytes(coming_bytes);
  if (!HandOver(ToPeerFrame(message))) return false;
  large_frame_notice_.OnReportSent(coming_bytes);
  ++sent_reports_;
  received_.OnReported();
  told_credit_bytes_ = credit_bytes;
  is_opening_due_ = false;
  is_asking_ = false;
  is_report_due_ = false;
  return true;
}

bool PeerLink::SendFrame(MonotonicTime now, const Outbox::Entry& entry) {
  if (!HandOver(entry.frame)) return false;
  large_frame_notice_.OnFrameSent();
  credit_.OnSent(now, entry.frame.size());
  sent_messages_ += entry.messages;
  sent_bytes_ += entry.frame.size();
  return true;
}

bool PeerLink::HandOver(const std::string& bytes) {
  ZmqFrame frame(bytes);
  is_socket_full_ = dealer_->Send(&frame) != ZmqSend::kSent;
  return !is_socket_full_;
}

void PeerLink::UpdateExpectation(MonotonicTime now) {
  if (!is_open_) return;
  const bool is_blocked = !outbox_.empty() && credit_.unreported_bytes() > 0;
  health_.Expect(now, credit_.unreported_bytes() > 0, is_blocked);
}

Duration PeerLink::Patience() const {
  const std::uint64_t unreported = credit_.unreported_bytes();
  const std::uint64_t beyond = unreported > credit_.credit_bytes() ? unreported - credit_.credit_bytes() : 0;
  return TimeFor(beyond) + TimeFor(coming_bytes_);
}

}  // namespace moondb
