#include "runtime/transport/peer_link.h"

#include <spdlog/spdlog.h>
#include <zmq.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <utility>

#include "proto/status.pb.h"
#include "runtime/one_writer.h"

namespace moondb {
namespace {

using std::chrono::seconds;

// A burst begins after this many messages in a row, each less than kBurstPause after the previous one.
constexpr int kSentAtOnce = 4;
constexpr Duration kBurstPause = std::chrono::microseconds(20);
// How long a small message in a burst waits for others to share its frame.
constexpr Duration kSharedFrameDelay = std::chrono::microseconds(100);
// Rate of the slowest usable radio. While a large frame is in flight, deadlines are extended by the time that the frame
// takes at this rate.
constexpr std::uint64_t kBytesPerSecondMin = 16 * 1024;
// After a detection of two processes with one key, Status reports them for this time.
constexpr std::chrono::minutes kTwoProcessesShown(10);
// Two restarts of the peer within kTwoProcessesShown increase LinkOrder::returns by at most this number.
constexpr int kReturnsOfRestartsMax = 4;

static_assert(kPeerMessageBytesMax == kPeerFrameBytesMax - kPeerFrameBytesMore);

MonotonicTime SteadyNow() { return std::chrono::steady_clock::now(); }

Duration TimeFor(std::uint64_t bytes) { return seconds(bytes / kBytesPerSecondMin); }

}  // namespace

Result<std::unique_ptr<PeerLink>> PeerLink::Make(const ZmqContext& context, WakeUp& wake_up, Options options) {
  std::unique_ptr<PeerLink> link(new PeerLink(context, wake_up, std::move(options)));
  const std::lock_guard lock(link->mutex_);
  if (const auto begun = link->connection_.Connect(SteadyNow()); !begun) return tl::unexpected(begun.error());
  return link;
}

// Connection numbers start at a random value. A late report that was meant for a previous process of this agent then
// matches no connection of this process.
PeerLink::PeerLink(const ZmqContext& context, WakeUp& wake_up, Options options)
    : wake_up_(wake_up),
      options_(std::move(options)),
      connection_(context, options_.connection),
      link_number_(std::random_device{}()),
      credit_(options_.credit),
      health_(options_.health),
      outbox_(options_.outbox) {}

void PeerLink::Disconnect(MonotonicTime now) {
  connection_.Disconnect(now);
  OnDisconnected();
}

void PeerLink::OnDisconnected() {
  if (!is_open_.exchange(false)) return;
  counts_.dropped_messages += outbox_.Clear();
  changes_.push_back(false);
}

SendResult PeerLink::Send(const proto::Message& message) {
  Outbox::Entry entry;
  const std::size_t bytes = message.ByteSizeLong();
  const bool is_small_enough = bytes <= options_.connection.frame_bytes_max - kPeerFrameBytesMore;
  if (is_open_ && is_small_enough) {
    entry.frame = ToPeerFrame(message);
    entry.outbound_class = OutboundClassOf(message);
    entry.key = ReplaceKeyOf(message);
  }
  const MonotonicTime now = SteadyNow();
  MonotonicTime due = MonotonicTime::max();
  {
    const std::lock_guard lock(mutex_);
    SendResult result = is_small_enough ? SendResult::kAccepted : SendResult::kTooLong;
    // The frame is empty if the link opened after the first check of is_open_. Refuse the message then.
    if (!is_open_ || (is_small_enough && entry.frame.empty())) result = SendResult::kUnreachable;
    if (result == SendResult::kAccepted) result = SendOrKeep(now, std::move(entry));
    if (result != SendResult::kAccepted) {
      ++counts_.dropped_messages;
      if (result == SendResult::kTooLong) WarnOfTooLong(message, bytes);
      return result;
    }
    // No wake-up is needed: the first waiting message has already scheduled the transport's thread.
    if (outbox_.messages() > 1 && flush_at_ > now && credit_.HasRoomFor(outbox_.bytes())) return result;
    UpdateExpectation(now);
    due = Deadline();
  }
  wake_up_.RingFor(due);
  return SendResult::kAccepted;
}

void PeerLink::WarnOfTooLong(const proto::Message& message, std::size_t bytes) {
  log_.Warn("transport: a message of " + std::to_string(bytes) + " bytes from " + message.source_actor() + " to " +
            options_.name + " was not sent: a frame between agents has at most " +
            std::to_string(options_.connection.frame_bytes_max));
}

// Sends the frame on the calling thread if possible, otherwise queues it in the outbox. Frames larger than the credit
// are always queued, because the transport's thread must announce them first.
SendResult PeerLink::SendOrKeep(MonotonicTime now, Outbox::Entry&& entry) {
  const bool is_for_shared_frame = burst_.IsInBurst(now) && entry.frame.size() * 2 <= SharedFrameBytesMax();
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
  if (reports_.is_opening_due() || bytes > credit_.credit_bytes()) return false;
  if (credit_.HasRoomFor(bytes)) return SendFrame(now, entry);
  credit_.OnBlocked();
  return false;
}

// Returns the size limit of a shared frame: an eighth of the credit, at most kSharedFrameBytesMax. Initially that is 4
// KiB, which a 1 Mbps radio sends in 33 ms.
std::size_t PeerLink::SharedFrameBytesMax() const { return std::min(credit_.credit_bytes() / 8, kSharedFrameBytesMax); }

bool PeerLink::Burst::IsInBurst(MonotonicTime now) {
  sent_in_a_row_ = now - last_sent_ < kBurstPause ? std::min(sent_in_a_row_ + 1, kSentAtOnce) : 0;
  last_sent_ = now;
  return sent_in_a_row_ >= kSentAtOnce;
}

proto::PeerStatus PeerLink::Status() const {
  proto::PeerStatus status;
  const std::int64_t heard_ns = received_.heard_ns;
  const std::int64_t two_processes_ns = received_.two_processes_ns;
  const std::int64_t now_ns = SteadyNow().time_since_epoch().count();
  status.set_agent_id(options_.connection.peer);
  status.set_name(options_.name);
  status.set_seconds_since_heard(heard_ns < 0 ? -1.0 : static_cast<double>(now_ns - heard_ns) * 1e-9);
  status.set_has_two_processes(two_processes_ns >= 0 &&
                               std::chrono::nanoseconds(now_ns - two_processes_ns) < kTwoProcessesShown);
  status.set_received_messages(static_cast<double>(received_.messages));
  status.set_received_bytes(static_cast<double>(received_.bytes));
  status.set_rejected_messages(static_cast<double>(received_.rejected_messages));
  const std::lock_guard lock(mutex_);
  status.set_is_connected(is_open_);
  status.set_sent_messages(static_cast<double>(counts_.sent_messages));
  status.set_sent_bytes(static_cast<double>(counts_.sent_bytes));
  status.set_dropped_messages(static_cast<double>(counts_.dropped_messages));
  status.set_queued_messages(static_cast<double>(outbox_.messages()));
  status.set_queued_bytes(static_cast<double>(outbox_.bytes()));
  status.set_unreported_bytes(static_cast<double>(is_open_ ? credit_.unreported_bytes() : 0));
  status.set_replaced_messages(static_cast<double>(outbox_.replaced()));
  status.set_connects(static_cast<double>(counts_.connects));
  status.set_cut_for_bytes(static_cast<double>(counts_.cut_for_bytes));
  status.set_lost_by_deadline(static_cast<double>(counts_.lost_by_deadline));
  status.set_sent_reports(static_cast<double>(counts_.sent_reports));
  status.set_refused_reports(static_cast<double>(counts_.refused_reports));
  return status;
}

void PeerLink::OnMessages(std::size_t count, std::size_t frame_bytes, bool is_on_link) {
  is_heard_ = true;
  // Set heard_ns before the messages are delivered, because their receivers may read it through Status.
  received_.heard_ns = SteadyNow().time_since_epoch().count();
  if (received_.coming_bytes.load(std::memory_order_relaxed) != 0) received_.coming_bytes = 0;
  Increase(received_.messages, count);
  Increase(received_.bytes, frame_bytes);
  if (is_on_link) received_count_.OnReceived(frame_bytes);
}

void PeerLink::OnReturn() {
  const MonotonicTime now = SteadyNow();
  if (now - received_.returned_at > kTwoProcessesShown) received_.returns = 0;
  received_.returned_at = now;
  if (++received_.returns <= kReturnsOfRestartsMax) return;
  received_.two_processes_ns = now.time_since_epoch().count();
  log_.Warn("transport: two processes use the key of " + options_.name + ": they replace each other's connection");
}

void PeerLink::OnRejected(std::size_t frame_bytes, bool is_on_link) {
  Increase(received_.rejected_messages, 1);
  if (is_on_link) received_count_.OnReceived(frame_bytes);
}

void PeerLink::OnReport(const proto::LinkReport& report, std::uint32_t link_number, bool is_on_link) {
  is_heard_ = true;
  const std::lock_guard lock(mutex_);
  if (!is_on_link) {
    ++counts_.refused_reports;
    return;
  }
  // The peer has opened a new connection to this agent. Reconnect immediately: the peer is reachable and waits for
  // reports.
  if (received_count_.OnLink(link_number) && !is_open_) is_hurried_ = true;
  if (report.report_after_bytes() != 0) received_count_.SetReportAfter(report.report_after_bytes());
  if (report.is_asking()) reports_.Request();
  received_.coming_bytes = std::min<std::uint64_t>(report.coming_bytes(), options_.connection.frame_bytes_max);
  if (report.reported_link() == 0 || !is_open_) return;
  const MonotonicTime now = SteadyNow();
  const std::uint64_t unreported_before = credit_.unreported_bytes();
  if (!credit_.OnReport(now, report.reported_link(), report.received_bytes())) {
    ++counts_.refused_reports;
    return;
  }
  if (credit_.unreported_bytes() < unreported_before) health_.OnProgress(now);
}

void PeerLink::OnMonitorReadable() {
  const std::lock_guard lock(mutex_);
  while (const std::optional<ZmqEvent> event = connection_.ReceiveEvent()) OnEvent(*event, SteadyNow());
}

std::optional<int> PeerLink::TakeConnectedFile() { return std::exchange(connected_file_, std::nullopt); }

void PeerLink::OnFlooded(MonotonicTime now) {
  const std::lock_guard lock(mutex_);
  ++counts_.cut_for_bytes;
  log_.Warn("transport: closed the link to " + options_.name + " for 30 s: it sent data over this agent's own link");
  connection_.DisconnectForLong(now);
  OnDisconnected();
}

void PeerLink::OnSocketReadable() {
  const std::lock_guard lock(mutex_);
  connection_.OnReadable();
}

void PeerLink::OnEvent(const ZmqEvent& event, MonotonicTime now) {
  switch (event.type) {
    case ZMQ_EVENT_CONNECTED:
      connected_file_ = event.value;
      return;
    case ZMQ_EVENT_HANDSHAKE_SUCCEEDED:
      if (is_open_) return;
      is_open_ = true;
      ++counts_.connects;
      link_number_ += link_number_ == UINT32_MAX ? 2 : 1;  // Skip 0, which means "no connection".
      credit_.Open(link_number_);
      health_.OnOpened(now);
      reports_.OnOpened();
      connection_.OnOpened();
      changes_.push_back(true);
      return;
    case ZMQ_EVENT_DISCONNECTED:
      // Before the handshake, libzmq retries by itself.
      if (is_open_) Disconnect(now);
      return;
    default:
      log_.Warn("transport: " + options_.name + " at " + options_.connection.address +
                " does not admit this agent's key, or does not hold its own key of the team file");
  }
}

void PeerLink::OnHeard(MonotonicTime now) {
  received_.heard_ns = now.time_since_epoch().count();
  health_.OnHeard(now);
  connection_.OnHeard(now, is_hurried_);
}

void PeerLink::CheckHealth(MonotonicTime now) {
  switch (health_.Check(now, Patience())) {
    case LinkHealth::Step::kNone:
      return;
    case LinkHealth::Step::kAsk:
      reports_.RequestPeer();
      return;
    case LinkHealth::Step::kStalled:
    case LinkHealth::Step::kLost:
      ++counts_.lost_by_deadline;
      Disconnect(now);
      return;
  }
}

void PeerLink::Work(MonotonicTime now, const Transport::PeerChanged& peer_changed) {
  std::vector<bool> changes;
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(is_heard_, false)) OnHeard(now);
    if (const auto at = connection_.connect_at(); at && now >= *at) {
      if (const auto begun = connection_.Connect(now); !begun) log_.Warn("transport: " + ToString(begun.error()));
    }
    is_hurried_ = false;
    if (is_open_) CheckHealth(now);
    if (is_open_) Flush(now);
    changes.swap(changes_);
  }
  for (const bool is_connected : changes) {
    change_log_.Info("transport: " + options_.name + " is " + (is_connected ? "connected" : "lost"));
    peer_changed(options_.connection.peer, is_connected);
  }
}

MonotonicTime PeerLink::deadline() const {
  const std::lock_guard lock(mutex_);
  return Deadline();
}

MonotonicTime PeerLink::Deadline() const {
  if (const auto at = connection_.connect_at()) return *at;
  if (!is_open_) return MonotonicTime::max();
  if (!connection_.is_full() && reports_.IsDue(credit_)) return MonotonicTime::min();
  const MonotonicTime health_at = health_.deadline(Patience());
  return CanSendWaiting() ? std::min(flush_at_, health_at) : health_at;
}

bool PeerLink::CanSendWaiting() const {
  return !connection_.is_full() && !outbox_.empty() && credit_.HasRoomFor(outbox_.Front()->frame.size());
}

void PeerLink::Flush(MonotonicTime now) {
  if (reports_.IsDue(credit_) || received_count_.is_report_due()) {
    reports_.Request();  // Keeps the report due, in case it cannot be sent now.
    if (!SendReport(0)) return;
  }
  if (now >= flush_at_) SendWaiting(now);
  while (const Outbox::Entry* front = outbox_.Front()) {
    const std::size_t bytes = front->frame.size();
    if (bytes <= credit_.credit_bytes() || !credit_.HasRoomFor(bytes)) break;
    if (!reports_.HasAnnounced(bytes) && !SendReport(bytes)) break;
    if (!SendFrame(now, *front)) break;
    outbox_.PopFront();
    SendWaiting(now);
  }
  UpdateExpectation(now);
}

// Sends waiting frames until the credit is used up, the socket is full, or a report must be sent first.
void PeerLink::SendWaiting(MonotonicTime now) {
  while (const Outbox::Entry* front = outbox_.Front()) {
    const std::size_t bytes = front->frame.size();
    if (!credit_.HasRoomFor(bytes)) return credit_.OnBlocked();
    if (reports_.is_opening_due() || bytes > credit_.credit_bytes() || !SendFrame(now, *front)) return;
    outbox_.PopFront();
  }
}

bool PeerLink::SendReport(std::uint64_t coming_bytes) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_hop_sender(options_.connection.self);
  *message.mutable_link_report() = reports_.Make(credit_, received_count_, coming_bytes);
  if (!connection_.Send(link_number_, ToPeerFrame(message))) return false;
  reports_.OnSent(credit_, coming_bytes);
  received_count_.OnReported();
  ++counts_.sent_reports;
  return true;
}

bool PeerLink::SendFrame(MonotonicTime now, const Outbox::Entry& entry) {
  if (!connection_.Send(link_number_, entry.frame)) return false;
  reports_.OnFrameSent();
  credit_.OnSent(now, entry.frame.size());
  counts_.sent_messages += entry.messages;
  counts_.sent_bytes += entry.frame.size();
  return true;
}

void PeerLink::UpdateExpectation(MonotonicTime now) {
  if (!is_open_) return;
  const bool is_blocked = !outbox_.empty() && credit_.unreported_bytes() > 0;
  health_.Expect(now, credit_.unreported_bytes() > 0, is_blocked);
}

Duration PeerLink::Patience() const {
  const std::uint64_t unreported = credit_.unreported_bytes();
  const std::uint64_t beyond = unreported > credit_.credit_bytes() ? unreported - credit_.credit_bytes() : 0;
  return TimeFor(beyond) + TimeFor(received_.coming_bytes);
}

}  // namespace moondb
