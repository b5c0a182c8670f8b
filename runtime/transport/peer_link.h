// PeerLink: sends messages to one peer over a connection on which only this agent sends, and counts the traffic with
// the peer in both directions.
//
// The link reconnects if the connection breaks (runtime/transport/peer_connection.h) or the peer is silent for too long
// (runtime/transport/link_health.h). The link counts as connected after the handshake, in which CURVE has verified that
// the other end holds the peer's secret key.
//
// At most one credit of bytes is in flight (runtime/transport/link_credit.h); all other messages wait in the outbox.
// Losing the connection clears the outbox: senders retransmit, and old messages would delay the retransmissions.
//
// Send and Status are thread-safe. All other functions must be called on the transport's thread.
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
  // An unstable link logs this many connects and disconnects in a row, then one per RateLimitedLog::kPeriod.
  static constexpr int kLoggedChangesAtOnce = 20;

  struct Options {
    std::string name;
    PeerConnection::Options connection;
    LinkCredit::Options credit;
    Outbox::Options outbox;
    LinkHealth::Options health;
  };

  // Starts to connect. Requires: `context` and `wake_up` outlive the link. Returns kUnavailable if sockets cannot be
  // created.
  static Result<std::unique_ptr<PeerLink>> Make(const ZmqContext& context, WakeUp& wake_up, Options options);

  // Sends a message or queues it in the outbox. Returns kUnreachable if the link is not connected, kFull if the outbox
  // is full, kTooLong if the frame would exceed connection.frame_bytes_max.
  SendResult Send(const proto::Message& message);
  proto::PeerStatus Status() const;

  // Call when a frame of this peer with `count` messages arrived. `is_on_link`: true if the frame arrived over the
  // peer's newest connection, false if over a replaced one. Only bytes of the newest connection count in the reports to
  // the peer.
  void OnMessages(std::size_t count, std::size_t frame_bytes, bool is_on_link);
  void OnReport(const proto::LinkReport& report, std::uint32_t link_number, bool is_on_link);
  // Call when LinkOrder::returns of the peer has increased. Repeated calls mean that two processes use the peer's
  // key; OnReturn then logs this, and Status reports it.
  void OnReturn();
  // Call when a frame was rejected. Its bytes still count as received.
  void OnRejected(std::size_t frame_bytes, bool is_on_link);

  // Processes the events that the connection's monitor has reported.
  void OnMonitorReadable();
  // Returns the descriptor of the TCP connection if it opened since the last call, otherwise nothing.
  std::optional<int> TakeConnectedFile();
  // Call when the peer sent data over this link, on which only this agent may send. Closes the connection for 30 s.
  void OnFlooded(MonotonicTime now);
  void OnSocketReadable();

  // Call after all received frames were passed to OnMessages, OnReport or OnRejected. Opens or closes the connection,
  // sends reports and waiting messages, and calls `peer_changed` for each connect and disconnect since the last call.
  void Work(MonotonicTime now, const Transport::PeerChanged& peer_changed);
  MonotonicTime deadline() const;  // Time at which Work must run even if nothing arrives.

  int socket_file() const { return connection_.socket_file(); }  // -1: no socket exists.
  int monitor_file() const { return connection_.monitor_file(); }
  const std::string& name() const { return options_.name; }

 private:
  PeerLink(const ZmqContext& context, WakeUp& wake_up, Options options);

  // Detects bursts: Send calls without a pause. In a burst, small messages are delayed to share a frame.
  class Burst {
   public:
    bool IsInBurst(MonotonicTime now);

   private:
    MonotonicTime last_sent_;
    int sent_in_a_row_ = 0;
  };

  // Functions that require mutex_ to be held.
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

  // Counters of received data. Written by the transport's thread only.
  struct Received {
    std::atomic<std::int64_t> heard_ns{-1};  // Last time the peer was heard, on the steady clock; negative: never.
    // Last time that two processes with the peer's key were detected, on the steady clock; negative: never.
    std::atomic<std::int64_t> two_processes_ns{-1};
    MonotonicTime returned_at;
    // Number of successive returns (LinkOrder), each at most kTwoProcessesShown after the previous one.
    int returns = 0;
    std::atomic<std::uint64_t> messages{0};
    std::atomic<std::uint64_t> bytes{0};
    std::atomic<std::uint64_t> rejected_messages{0};
    std::atomic<std::uint64_t> coming_bytes{0};  // Size of the large frame that the peer announced; 0: none.
  };
  // Counters of sent data and of connections.
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
  std::atomic<bool> is_open_{false};  // Written under mutex_. Send also reads it without mutex_.
  std::uint32_t link_number_;         // Number of the current or last connection.
  LinkCredit credit_;
  LinkHealth health_;
  Outbox outbox_;
  ReportState reports_;
  ReceivedCount received_count_;
  Burst burst_;
  MonotonicTime flush_at_;  // Waiting messages are held back until this time, to share frames.
  Counts counts_;

  // Events since the last Work. Transport's thread only.
  bool is_heard_ = false;
  // True if the peer connected to this agent while this link was closed.
  bool is_hurried_ = false;
  std::vector<bool> changes_;
  std::optional<int> connected_file_;

  Received received_;
};

}  // namespace moondb
