// ReportState: decides when a link must send a report (proto::LinkReport), and remembers what the last report
// contained.
//
// Not thread-safe: the caller provides the locking.
#pragma once

#include <cstddef>
#include <cstdint>

#include "proto/message.pb.h"
#include "runtime/transport/link_credit.h"

namespace moondb {

class ReportState {
 public:
  // Call when a new connection opened. The first frame on a connection must be a report.
  void OnOpened();
  bool is_opening_due() const { return is_opening_due_; }

  void Request() { is_due_ = true; }  // Makes a report due: the peer requested one, or enough bytes arrived.
  void RequestPeer() { is_asking_peer_ = true; }  // Makes a report due that requests a report from the peer.

  bool IsDue(const LinkCredit& credit) const {
    return is_opening_due_ || is_asking_peer_ || is_due_ || reported_credit_bytes_ != credit.credit_bytes();
  }
  // Returns the report to send. `coming_bytes` is the size of the next frame if that frame must be announced, otherwise
  // 0.
  proto::LinkReport Make(const LinkCredit& credit, const ReceivedCount& received, std::uint64_t coming_bytes) const;
  // Call when the last result of Make was passed to the socket.
  void OnSent(const LinkCredit& credit, std::uint64_t coming_bytes);

  void OnFrameSent() { large_frame_notice_.OnFrameSent(); }
  // Returns true if the announced frame has this size. The peer then extends its deadlines for that frame.
  bool HasAnnounced(std::uint64_t frame_bytes) const { return large_frame_notice_.Covers(frame_bytes); }

 private:
  bool is_opening_due_ = false;
  bool is_due_ = false;
  bool is_asking_peer_ = false;
  // Credit when the last report was sent. If the credit has changed since, the next report sets a new report interval.
  std::size_t reported_credit_bytes_ = 0;
  LargeFrameNotice large_frame_notice_;
};

}  // namespace moondb
