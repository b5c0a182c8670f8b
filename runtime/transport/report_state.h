// ReportState: decides when a link must send a report (proto::LinkReport), and remembers what the last report
// contained.
//
// Bookkeeping of the sending end. Not thread-safe: the caller provides the locking.
#pragma once

#include <cstddef>
#include <cstdint>

#include "proto/message.pb.h"
#include "runtime/transport/link_credit.h"

namespace moondb {

class ReportState {
 public:
  // Call when a new connection opened. Its first report must precede everything else on it.
  void OnOpened();
  bool is_opening_due() const { return is_opening_due_; }

  void Request() { is_due_ = true; }          // The peer requested a report, or the received bytes require one.
  void AskPeer() { is_asking_peer_ = true; }  // The next report requests one from the peer.

  bool IsDue(const LinkCredit& credit) const {
    return is_opening_due_ || is_asking_peer_ || is_due_ || reported_credit_bytes_ != credit.credit_bytes();
  }
  // Returns the report to send. `coming_bytes` is the size of the next frame if that frame must be announced, otherwise
  // 0.
  proto::LinkReport Make(const LinkCredit& credit, const ReceivedCount& received, std::uint64_t coming_bytes) const;
  // Call when the last result of Make was passed to the socket.
  void OnSent(const LinkCredit& credit, std::uint64_t coming_bytes);

  void OnFrameSent() { large_frame_notice_.OnFrameSent(); }
  // True if the peer expects a frame of this size, and extends its deadlines for it.
  bool HasAnnounced(std::uint64_t frame_bytes) const { return large_frame_notice_.Covers(frame_bytes); }

 private:
  bool is_opening_due_ = false;
  bool is_due_ = false;
  bool is_asking_peer_ = false;
  std::size_t reported_credit_bytes_ = 0;  // Credit in the last report. The peer derives its report interval from it.
  LargeFrameNotice large_frame_notice_;
};

}  // namespace moondb
