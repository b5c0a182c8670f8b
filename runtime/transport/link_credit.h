// LinkCredit, LargeFrameNotice, ReceivedCount: flow control by credit. The peer reports how many bytes have arrived
// (proto::LinkReport), and the sender keeps at most one credit of unreported bytes in flight. All other frames wait in
// the outbox, where control messages overtake them.
//
// ZeroMQ's high-water mark is not enough. It counts messages on the sending side only: megabytes for a peer that does
// not read would enter libzmq and both kernels, become stale, and be lost with the connection.
//
// The credit starts small, for slow radios, and grows when reports arrive quickly. This keeps the delay of the bytes in
// flight at a fraction of a second on any link. Each direction has its own connection, numbered by its sender. Reports
// about earlier connections are ignored.
//
// Reads no clock: each call passes the time in. Not thread-safe: the caller provides the locking.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "runtime/actor.h"

namespace moondb {

// Limits the bytes in flight from this agent to one peer, over successive connections.
class LinkCredit {
 public:
  struct Options {
    std::size_t bytes_min = 32 * 1024;    // Smallest and initial credit: 0.26 s of a 1 Mbps radio.
    std::size_t bytes_max = 1024 * 1024;  // Largest credit; at least bytes_min.
    // The credit doubles if the peer reports sent bytes (Round) within this time and a frame had to wait for credit.
    // The credit is halved if the peer takes more than four times as long.
    Duration round_fast = std::chrono::milliseconds(25);
  };

  explicit LinkCredit(const Options& options) : options_(options), credit_bytes_(options.bytes_min) {}

  // Call when a new connection with the number `link` (not 0) opened, before anything is sent over the connection.
  void Open(std::uint32_t link);

  // Returns true if a frame of this size may be sent now. A frame larger than the credit may be sent when nothing else
  // is in flight.
  bool HasRoomFor(std::size_t frame_bytes) const {
    return unreported_bytes() == 0 || unreported_bytes() + frame_bytes <= credit_bytes_;
  }
  void OnSent(MonotonicTime now, std::size_t frame_bytes);
  // Call when a frame had to wait for credit.
  void OnBlocked() { was_blocked_ = true; }

  // Processes a report of the peer. Returns false, without effect, if the report is about another connection, is older
  // than an earlier one, or claims more than was sent.
  bool OnReport(MonotonicTime now, std::uint32_t link, std::uint64_t received_bytes);

  std::uint32_t link() const { return link_; }
  std::uint64_t unreported_bytes() const { return sent_bytes_ - reported_bytes_; }
  std::size_t credit_bytes() const { return credit_bytes_; }

 private:
  // Measures how long the peer takes to report sent bytes: from `begun` until the peer has reported the first
  // `sent_bytes` bytes of the connection.
  struct Round {
    MonotonicTime begun;
    std::uint64_t sent_bytes = 0;
  };
  void EndRound(MonotonicTime now);

  Options options_;
  std::size_t credit_bytes_;
  std::uint32_t link_ = 0;
  std::uint64_t sent_bytes_ = 0;
  std::uint64_t reported_bytes_ = 0;
  std::optional<Round> round_;  // Empty if nothing is in flight.
  bool was_blocked_ = false;    // True if a frame waited for credit in this round.
};

// Remembers the size of the large frame that was announced to the receiver. The announcement applies to the next frame
// only: sending any frame cancels it, and each later report replaces it.
class LargeFrameNotice {
 public:
  void OnReportSent(std::uint64_t coming_bytes) { announced_bytes_ = coming_bytes; }
  void OnFrameSent() { announced_bytes_ = 0; }
  // Returns true if the announced frame has this size. The receiver then extends its deadlines for that frame.
  bool Covers(std::uint64_t frame_bytes) const { return announced_bytes_ == frame_bytes; }

 private:
  std::uint64_t announced_bytes_ = 0;
};

// Counts the bytes that arrive from one peer, for the reports to the peer.
class ReceivedCount {
 public:
  // Call with the number of the connection over which a frame arrived. If the number has changed, restarts counting at
  // 0 and returns true; otherwise returns false.
  bool OnLink(std::uint32_t link);
  void SetReportAfter(std::size_t bytes) { report_after_bytes_ = bytes; }

  void OnReceived(std::size_t frame_bytes) { received_bytes_ += frame_bytes; }
  void OnReported() { reported_bytes_ = received_bytes_; }

  bool is_report_due() const {
    return link_ != 0 && received_bytes_ > reported_bytes_ && received_bytes_ - reported_bytes_ >= report_after_bytes_;
  }
  std::uint32_t link() const { return link_; }
  std::uint64_t received_bytes() const { return received_bytes_; }

 private:
  std::uint32_t link_ = 0;
  std::size_t report_after_bytes_ = 0;
  std::uint64_t received_bytes_ = 0;
  std::uint64_t reported_bytes_ = 0;
};

}  // namespace moondb
