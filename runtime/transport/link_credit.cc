#include "runtime/transport/link_credit.h"

#include <algorithm>

namespace moondb {

void LinkCredit::Open(std::uint32_t link) {
  link_ = link;
  credit_bytes_ = options_.bytes_min;
  sent_bytes_ = 0;
  reported_bytes_ = 0;
  round_.reset();
  was_blocked_ = false;
}

void LinkCredit::OnSent(MonotonicTime now, std::size_t frame_bytes) {
  sent_bytes_ += frame_bytes;
  if (!round_) round_ = Round{now, sent_bytes_};
}

bool LinkCredit::OnReport(MonotonicTime now, std::uint32_t link, std::uint64_t received_bytes) {
  if (link != link_ || received_bytes < reported_bytes_ || received_bytes > sent_bytes_) return false;
  reported_bytes_ = received_bytes;
  if (round_ && reported_bytes_ >= round_->sent_bytes) EndRound(now);
  return true;
}

void LinkCredit::EndRound(MonotonicTime now) {
  const Duration round = now - round_->begun;
  if (was_blocked_ && round <= options_.round_fast) {
    credit_bytes_ = std::min(credit_bytes_ * 2, options_.bytes_max);
  } else if (round > 4 * options_.round_fast) {
    credit_bytes_ = std::max(credit_bytes_ / 2, options_.bytes_min);
  }
  was_blocked_ = false;
  round_.reset();
  if (unreported_bytes() > 0) round_ = Round{now, sent_bytes_};
}

bool ReceivedCount::OnLink(std::uint32_t link) {
  if (link == link_) return false;
  link_ = link;
  received_bytes_ = 0;
  reported_bytes_ = 0;
  return true;
}

}  // namespace moondb
