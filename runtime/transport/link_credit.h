// LinkCredit, LargeFrameNotice, ReceivedCount: how much may be under way to a peer, by what the peer says has arrived.
//
// A high-water mark counts messages on this side alone: a peer that does not read still lets megabytes into libzmq and
// the two kernels, which then are stale, late and lost with the connection. So each end reports to the other how many
// bytes have arrived (proto::LinkReport), and no more than a credit go out beyond that; the rest waits in the outbox,
// where control messages overtake it. The credit is small, as a slow radio needs it, and grows while a whole credit's
// worth is reported within a moment: what is under way stays a matter of a fraction of a second on any link. Each
// direction is a connection of its own; its sender numbers it, so that a report about an earlier one is known as such.
//
// Plain accounting: time comes in with each call. Its owner guards it.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "runtime/actor.h"

namespace moondb {

// The sending end of one connection after another.
class LinkCredit {
 public:
  struct Options {
    std::size_t bytes_min = 32 * 1024;    // 0.26 s of a 1 Mbps radio.
    std::size_t bytes_max = 1024 * 1024;  // At least bytes_min.
    // What was under way is reported within so long: the credit doubles if it was all used; longer than four times
    // that: it is halved. A 1 Mbps radio takes 260 ms for the smallest credit.
    Duration round_fast = std::chrono::milliseconds(25);
  };

  explicit LinkCredit(const Options& options) : options_(options), credit_bytes_(options.bytes_min) {}

  // A new connection, numbered `link` (not 0): nothing has been sent over it.
  void Open(std::uint32_t link);

  // A frame may go out now. One that is larger than the credit goes alone.
  bool HasRoomFor(std::size_t frame_bytes) const {
    return unreported_bytes() == 0 || unreported_bytes() + frame_bytes <= credit_bytes_;
  }
  void OnSent(MonotonicTime now, std::size_t frame_bytes);
  // A frame had no room.
  void OnBlocked() { was_blocked_ = true; }

  // False, and nothing happens, for a report about another connection than the present one, one that goes back behind
  // an earlier one, and one about more than was sent.
  bool OnReport(MonotonicTime now, std::uint32_t link, std::uint64_t received_bytes);

  std::uint32_t link() const { return link_; }
  std::uint64_t unreported_bytes() const { return sent_bytes_ - reported_bytes_; }
  std::size_t credit_bytes() const { return credit_bytes_; }

 private:
  // From `begun` on until what had been sent by then is reported.
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
  std::optional<Round> round_;  // None: nothing is under way.
  bool was_blocked_ = false;    // In this round.
};

// What was last announced to the receiver of a large frame to come. An announcement speaks of the next frame alone:
// another frame, or a report without one, that goes first takes it back.
class LargeFrameNotice {
 public:
  void OnReportSent(std::uint64_t coming_bytes) { announced_bytes_ = coming_bytes; }
  void OnFrameSent() { announced_bytes_ = 0; }
  // The receiver waits patiently for a frame of so many bytes.
  bool Covers(std::uint64_t frame_bytes) const { return announced_bytes_ == frame_bytes; }

 private:
  std::uint64_t announced_bytes_ = 0;
};

// The receiving end.
class ReceivedCount {
 public:
  // The connection over which frames come in now, as its sender numbers it. True if it is a new one: counting begins.
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
