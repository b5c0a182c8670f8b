// PeerLink: the way to one peer: a DEALER that only sends, its outbox, and what is counted about the peer.
//
// A DEALER lives for one connection: when that breaks, or its peer is silent for too long
// (runtime/transport/link_health.h), the socket is closed, with all that libzmq and the kernel still hold for it, and a
// new one made. Until a connection stands libzmq tries again and again by itself, from 100 ms to 4 s apart; a peer that
// reaches us is tried at once. The link counts as connected from the end of the handshake on, in which CURVE has shown
// that the other end holds the peer's secret key.
//
// No more than the credit is under way (runtime/transport/link_credit.h); the rest waits in the outbox, which drops
// what it has when the connection is lost: whoever sent it will send it again, and stale frames would only delay that.
//
// Send and Status: any thread; a sender hands its frame to the socket itself if nothing waits. In a burst small
// messages wait up to 0.1 ms for others that share their frame. All else: the transport's thread. A lock guards the
// socket and what belongs to it.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "runtime/rate_limited_log.h"
#include "runtime/team/curve_keys.h"
#include "runtime/transport.h"
#include "runtime/transport/link_credit.h"
#include "runtime/transport/link_health.h"
#include "runtime/transport/outbox.h"
#include "runtime/transport/wake_up.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb::proto {
class PeerStatus;
}  // namespace moondb::proto

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
    LinkCredit::Options credit;
    Outbox::Options outbox;
    LinkHealth::Options health;
  };

  // Begins to connect. `context` and `wake_up` (the transport's) outlive the link. kUnavailable if sockets cannot be
  // made.
  static Result<std::unique_ptr<PeerLink>> Make(const ZmqContext& context, WakeUp& wake_up, Options options);

  // A message too large for the peer is kFull.
  SendResult Send(const proto::Message& message);
  proto::PeerStatus Status() const;

  // A frame of this peer came in, with so many messages. `is_on_link`: over the connection that the peer's reports
  // speak of, not over one that it replaced.
  void OnMessages(std::size_t count, std::size_t frame_bytes, bool is_on_link);
  void OnReport(const proto::LinkReport& report, bool is_on_link);
  // A frame that was not taken. Its bytes have arrived all the same.
  void OnRejected(std::size_t frame_bytes, bool is_on_link);

  // What libzmq has to say of the connection, if anything.
  void OnMonitorReadable();
  void OnSocketReadable();

  // After all that came in was told: gives up or makes connections, sends reports and what waits. Then tells the
  // changes since the last time.
  void Work(MonotonicTime now, const Transport::PeerChanged& peer_changed);
  MonotonicTime deadline() const;  // Of the next Work, if nothing comes in.

  int socket_file() const { return dealer_ ? dealer_->file() : -1; }  // -1: none now.
  int monitor_file() const { return monitor_ ? monitor_->file() : -1; }
  const std::string& name() const { return options_.name; }

 private:
  PeerLink(const ZmqContext& context, WakeUp& wake_up, Options options);

  // With mutex_ held.
  Result<void> Connect(MonotonicTime now);
  void Disconnect(MonotonicTime now);
  void OnEvent(int event, MonotonicTime now);
  void OnHeard(MonotonicTime now);
  void CheckHealth(MonotonicTime now);
  void Flush(MonotonicTime now);
  void SendWaiting(MonotonicTime now);
  bool SendReport(std::uint64_t coming_bytes);
  bool HandOver(const std::string& bytes);
  bool SendFrame(MonotonicTime now, const Outbox::Entry& entry);
  bool TrySend(MonotonicTime now, const Outbox::Entry& entry);
  SendResult SendOrKeep(MonotonicTime now, Outbox::Entry&& entry);
  std::size_t SharedFrameBytesMax() const;
  bool IsInBurst(MonotonicTime now);
  void UpdateExpectation(MonotonicTime now);
  Duration Patience() const;
  bool HasReportDue() const;
  bool CanSendWaiting() const;
  MonotonicTime Deadline() const;

  const ZmqContext& context_;
  WakeUp& wake_up_;
  const Options options_;
  RateLimitedLog log_;

  mutable std::mutex mutex_;
  std::optional<ZmqSocket> monitor_;
  std::optional<ZmqSocket> dealer_;
  std::atomic<bool> is_open_{false};     // Read without the lock for a first look.
  std::uint32_t link_number_;            // Of the present or last connection.
  std::uint64_t connections_begun_ = 0;  // Names the monitors.
  std::optional<MonotonicTime> connect_at_;
  Duration connect_delay_{};  // Grows while nothing is heard.
  LinkCredit credit_;
  LinkHealth health_;
  Outbox outbox_;

  // Reports: what is due, and what was said.
  ReceivedCount received_;
  bool is_report_due_ = false;
  bool is_asking_ = false;
  bool is_opening_due_ = false;        // Nothing goes out over a connection before its first report.
  std::size_t told_credit_bytes_ = 0;  // By which the peer reports.
  MonotonicTime flush_at_;             // Before it, what waits is let share frames.
  MonotonicTime last_sent_;            // When Send was last called,
  int sent_in_a_row_ = 0;              // and how often without a pause.
  bool is_socket_full_ = false;        // Until its file tells of news.
  LargeFrameNotice large_frame_notice_;

  // Of the transport's thread, since the last Work.
  bool is_heard_ = false;
  bool is_hurried_ = false;
  std::vector<bool> changes_;

  std::atomic<std::uint64_t> coming_bytes_{0};  // The peer announced so large a frame.
  std::atomic<std::int64_t> heard_ns_{-1};      // Of the steady clock; negative: never.
  std::atomic<std::uint64_t> received_messages_{0};
  std::atomic<std::uint64_t> received_bytes_{0};
  std::atomic<std::uint64_t> rejected_messages_{0};
  std::uint64_t sent_messages_ = 0;
  std::uint64_t sent_bytes_ = 0;
  std::uint64_t dropped_messages_ = 0;
  std::uint64_t connects_ = 0;
  std::uint64_t lost_by_deadline_ = 0;
  std::uint64_t sent_reports_ = 0;
  std::uint64_t refused_reports_ = 0;
};

}  // namespace moondb
