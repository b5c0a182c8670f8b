#include "runtime/link_credit.h"

namespace moondb {

void LinkCredit::Open(std::uint32_t link) {
  link_ = link;
  has_report_ = false;
  sent_bytes_ = 0;
  reported_bytes_ = 0;
}

bool LinkCredit::OnReport(std::uint32_t link, std::uint64_t received_bytes) {
  if (link != link_ || received_bytes < reported_bytes_ || received_bytes > sent_bytes_) return false;
  has_report_ = true;
  reported_bytes_ = received_bytes;
  return true;
}

bool ReceivedCount::OnLink(std::uint32_t link) {
  if (link == link_) return false;
  link_ = link;
  received_bytes_ = 0;
  reported_bytes_ = 0;
  return true;
}

}  // namespace moondb
