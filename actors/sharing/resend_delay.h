// ResendDelay: how long a session waits without progress before it starts over (exponential backoff). The delay doubles
// up to a maximum and is reset by progress. Plain value.
#pragma once

#include <algorithm>
#include <chrono>
#include <utility>

namespace moondb {

class ResendDelay {
 public:
  using Duration = std::chrono::nanoseconds;

  ResendDelay(Duration first, Duration longest) : first_(first), longest_(longest), delay_(first) {}

  Duration delay() const { return delay_; }
  bool has_grown() const { return delay_ > first_; }

  void Grow() { delay_ = std::min(2 * delay_, longest_); }
  // Restores the first delay and forgets refusals.
  void Reset() {
    delay_ = first_;
    refusals_ = 0;
    has_started_over_at_once_ = false;
  }

  // Call when the destination refused a batch.
  void ObserveRefusal() { ++refusals_; }
  void ForgetRefusals() { refusals_ = 0; }
  // True if the destination refused at least two batches in a row.
  bool is_refused_again() const { return refusals_ > 1; }
  // Call when a batch was acknowledged, or when a page of the have-set arrived. `has_records`: the acknowledged batch
  // contained records, not only a fragment. A destination acknowledges fragments even if it cannot store their record,
  // so after a refusal only acknowledged records count as progress.
  void ObserveProgress(bool has_records) {
    if (has_records || refusals_ == 0) Reset();
  }
  // Call when the destination has forgotten the session. Returns true if the session may start over immediately, which
  // is allowed only once between two reports of progress. If false, the session must wait for delay().
  bool TakeStartAtOnce() { return !std::exchange(has_started_over_at_once_, true); }

 private:
  Duration first_;
  Duration longest_;
  Duration delay_;
  int refusals_ = 0;
  bool has_started_over_at_once_ = false;
};

}  // namespace moondb
