#include "runtime/transport/report_state.h"

#include <algorithm>

namespace moondb {

void ReportState::OnOpened() {
  is_opening_due_ = true;
  is_asking_peer_ = false;
  large_frame_notice_ = {};
}

proto::LinkReport ReportState::Make(const LinkCredit& credit, const ReceivedCount& received,
                                    std::uint64_t coming_bytes) const {
  proto::LinkReport report;
  report.set_reported_link(received.link());
  report.set_received_bytes(received.received_bytes());
  report.set_is_asking(is_asking_peer_);
  if (is_opening_due_ || reported_credit_bytes_ != credit.credit_bytes()) {
    report.set_report_after_bytes(static_cast<std::uint32_t>(std::max<std::size_t>(credit.credit_bytes() / 4, 1)));
  }
  report.set_coming_bytes(coming_bytes);
  return report;
}

void ReportState::OnSent(const LinkCredit& credit, std::uint64_t coming_bytes) {
  large_frame_notice_.OnReportSent(coming_bytes);
  reported_credit_bytes_ = credit.credit_bytes();
  is_opening_due_ = false;
  is_asking_peer_ = false;
  is_due_ = false;
}

}  // namespace moondb
