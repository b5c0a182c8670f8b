// LinkCredit, LargeFrameNotice, ReceivedCount: flow control by credit. They limit the bytes in flight to a peer, by the
// number of bytes that the peer reports as received.
//
// A high-water mark counts messages on the sending side only. Megabytes for a peer that does not read would still enter
// libzmq and both kernels. They would become stale and delayed, and be lost with the connection. Each end therefore
// reports how many bytes have arrived (proto::LinkReport). The sender keeps at most one credit of unreported bytes in
// flight. The rest waits in the outbox, where control messages overtake it. A full outbox refuses messages: this is the
// backpressure to the senders.
//
// The credit starts small, for slow radios. It grows when a full credit is reported quickly, which keeps the delay of
// the bytes in flight at a fraction of a second on any link. Each direction has its own connection, numbered by its
// sender. A report contains this number, and reports about earlier connections are ignored.
//
// Accounting only: each call passes the time in. The caller provides the locking.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "runtime/actor.h"

namespace moondb {

// The sending end of a link, over successive connections.
class LinkCredit {
 public:
  struct Options {
    std::size_t bytes_min = 32 * 1024;    // Smallest and initial credit: 0.26 s of a 1 Mbps radio.
    std::size_t bytes_max = 1024 * 1024;  // Upper limit; at least bytes_min.
    // The credit doubles if all bytes of a round are reported within this time and the credit was used up. It is halved
    // if a round takes more than four times as long. A 1 Mbps radio takes 260 ms for the smallest credit.
    Duration round_fast = std::chrono::milliseconds(25);
  };

  explicit LinkCredit(const Options& options) : options_(options), credit_bytes_(options.bytes_min) {}

  // Call when a new connection with the number `link` (not 0) opened. Nothing has been sent over it.
  void Open(std::uint32_t link);

  // True if a frame may be sent now. A frame larger than the credit is sent when nothing else is in flight.
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
  // A measurement that starts at `begun` and ends when the peer has reported the first `sent_bytes` bytes of the
  // connection.
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

// Remembers that a large frame was announced to its receiver. An announcement covers the next frame only. Another frame
// sent first, or a report without an announcement, cancels it.
class LargeFrameNotice {
 public:
  void OnReportSent(std::uint64_t coming_bytes) { announced_bytes_ = coming_bytes; }
  void OnFrameSent() { announced_bytes_ = 0; }
  // True if the receiver expects a frame of this size, and extends its deadlines for it.
  bool Covers(std::uint64_t frame_bytes) const { return announced_bytes_ == frame_bytes; }

 private:
  std::uint64_t announced_bytes_ = 0;
};

// The receiving end of a link.
class ReceivedCount {
 public:
  // Call with the number of the connection over which a frame arrived. If it is another connection than before,
  // restarts counting at 0 and returns true.
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
