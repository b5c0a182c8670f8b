// PeerLink: the way to one peer: a connection over which this agent only sends, its outbox, and what is counted about
// the peer.
//
// When a connection breaks (runtime/transport/peer_connection.h), or its peer is silent for too long
// (runtime/transport/link_health.h), a new one is made; a peer that reaches us is tried at once. The link counts as
// connected from the end of the handshake on, in which CURVE has shown that the other end holds the peer's secret key.
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
#include "runtime/transport.h"
#include "runtime/transport/link_credit.h"
#include "runtime/transport/link_health.h"
#include "runtime/transport/outbox.h"
#include "runtime/transport/peer_connection.h"
#include "runtime/transport/report_state.h"
#include "runtime/transport/wake_up.h"

namespace moondb::proto {
class PeerStatus;
}  // namespace moondb::proto

namespace moondb {

class PeerLink {
 public:
  // Of a link that comes and goes so many changes are logged at once, then one in a while.
  static constexpr int kLoggedChangesAtOnce = 20;

  struct Options {
    std::string name;
    PeerConnection::Options connection;
    LinkCredit::Options credit;
    Outbox::Options outbox;
    LinkHealth::Options health;
  };

  // Begins to connect. `context` and `wake_up` (the transport's) outlive the link. kUnavailable if sockets cannot be
  // made.
  static Result<std::unique_ptr<PeerLink>> Make(const ZmqContext& context, WakeUp& wake_up, Options options);

  // kTooLong for a message with which a frame would have more than connection.frame_bytes_max.
  SendResult Send(const proto::Message& message);
  proto::PeerStatus Status() const;

  // A frame of this peer came in, with so many messages. `is_on_link`: over the connection that the peer's reports
  // speak of, not over one that it replaced.
  void OnMessages(std::size_t count, std::size_t frame_bytes, bool is_on_link);
  void OnReport(const proto::LinkReport& report, std::uint32_t link_number, bool is_on_link);
  // A process with the peer's key returned (LinkOrder::returns).
  void OnReturn();
  // A frame that was not taken. Its bytes have arrived all the same.
  void OnRejected(std::size_t frame_bytes, bool is_on_link);

  // What libzmq has to say of the connection, if anything.
  void OnMonitorReadable();
  // Returns the descriptor of the connection that opened since the last call, if one did.
  std::optional<int> TakeConnectedFile();
  // The peer sends over the link, on which it has nothing to send: closes the connection for 30 s.
  void OnFlooded(MonotonicTime now);
  void OnSocketReadable();

  // After all that came in was given: gives up or makes connections, sends reports and what waits. Then reports the
  // changes since the last time.
  void Work(MonotonicTime now, const Transport::PeerChanged& peer_changed);
  MonotonicTime deadline() const;  // Of the next Work, if nothing comes in.

  int socket_file() const { return connection_.socket_file(); }  // -1: none now.
  int monitor_file() const { return connection_.monitor_file(); }
  const std::string& name() const { return options_.name; }

 private:
  PeerLink(const ZmqContext& context, WakeUp& wake_up, Options options);

  // Whether Send is called without a pause; then it is worth the detour to let small messages share a frame.
  class Burst {
   public:
    bool IsInBurst(MonotonicTime now);

   private:
    MonotonicTime last_sent_;
    int sent_in_a_row_ = 0;
  };

  // With mutex_ held.
  void Disconnect(MonotonicTime now);
  void OnDisconnected();
  void OnEvent(const ZmqEvent& event, MonotonicTime now);
  void OnHeard(MonotonicTime now);
  void CheckHealth(MonotonicTime now);
  void Flush(MonotonicTime now);
  void SendWaiting(MonotonicTime now);
  bool SendReport(std::uint64_t coming_bytes);
  bool SendFrame(MonotonicTime now, const Outbox::Entry& entry);
  bool TrySend(MonotonicTime now, const Outbox::Entry& entry);
  void WarnOfTooLong(const proto::Message& message, std::size_t bytes);
  SendResult SendOrKeep(MonotonicTime now, Outbox::Entry&& entry);
  std::size_t SharedFrameBytesMax() const;
  void UpdateExpectation(MonotonicTime now);
  Duration Patience() const;
  bool CanSendWaiting() const;
  MonotonicTime Deadline() const;

  // What came in; written by the transport's thread alone.
  struct Received {
    std::atomic<std::int64_t> heard_ns{-1};          // Steady clock; negative: never.
    std::atomic<std::int64_t> two_processes_ns{-1};  // Steady clock; negative: never.
    MonotonicTime returned_at;
    int returns = 0;  // Each within kTwoProcessesShown of the one before.
    std::atomic<std::uint64_t> messages{0};
    std::atomic<std::uint64_t> bytes{0};
    std::atomic<std::uint64_t> rejected_messages{0};
    std::atomic<std::uint64_t> coming_bytes{0};  // The peer announced so large a frame.
  };
  // What went out, and what became of connections.
  struct Counts {
    std::uint64_t sent_messages = 0;
    std::uint64_t sent_bytes = 0;
    std::uint64_t dropped_messages = 0;
    std::uint64_t connects = 0;
    std::uint64_t lost_by_deadline = 0;
    std::uint64_t cut_for_bytes = 0;
    std::uint64_t sent_reports = 0;
    std::uint64_t refused_reports = 0;
  };

  WakeUp& wake_up_;
  const Options options_;
  RateLimitedLog log_;
  RateLimitedLog change_log_{kLoggedChangesAtOnce};

  mutable std::mutex mutex_;
  PeerConnection connection_;
  std::atomic<bool> is_open_{false};  // Read without the lock for a first look.
  std::uint32_t link_number_;         // Of the present or last connection.
  LinkCredit credit_;
  LinkHealth health_;
  Outbox outbox_;
  ReportState reports_;
  ReceivedCount received_count_;
  Burst burst_;
  MonotonicTime flush_at_;  // Before it, what waits is let share frames.
  Counts counts_;

  // Of the transport's thread, since the last Work.
  bool is_heard_ = false;
  bool is_hurried_ = false;  // The peer reached us while we do not reach it.
  std::vector<bool> changes_;
  std::optional<int> connected_file_;

  Received received_;
};

}  // namespace moondb
