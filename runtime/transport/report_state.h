// ReportState: which report (proto::LinkReport) a link has to send, and what its peer knows by the last one.
//
// Plain accounting of the sending end; its owner guards it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "proto/message.pb.h"
#include "runtime/transport/link_credit.h"

namespace moondb {

class ReportState {
 public:
  // A new connection stands: nothing goes out over it before its first report.
  void OnOpened();
  bool is_opening_due() const { return is_opening_due_; }

  void Request() { is_due_ = true; }          // The peer asked for a report, or one is due by what came in.
  void AskPeer() { is_asking_peer_ = true; }  // The next report asks the peer for its own.

  bool IsDue(const LinkCredit& credit) const {
    return is_opening_due_ || is_asking_peer_ || is_due_ || reported_credit_bytes_ != credit.credit_bytes();
  }
  // `coming_bytes`: of the next frame if it is so large that it must be announced, else 0.
  proto::LinkReport Make(const LinkCredit& credit, const ReceivedCount& received, std::uint64_t coming_bytes) const;
  // What Make gave last was handed to the socket.
  void OnSent(const LinkCredit& credit, std::uint64_t coming_bytes);

  void OnFrameSent() { large_frame_notice_.OnFrameSent(); }
  // The peer waits patiently for a frame of so many bytes.
  bool HasAnnounced(std::uint64_t frame_bytes) const { return large_frame_notice_.Covers(frame_bytes); }

 private:
  bool is_opening_due_ = false;
  bool is_due_ = false;
  bool is_asking_peer_ = false;
  std::size_t reported_credit_bytes_ = 0;  // The credit by which the peer reports.
  LargeFrameNotice large_frame_notice_;
};

}  // namespace moondb
