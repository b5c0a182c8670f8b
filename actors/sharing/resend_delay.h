// ResendDelay: how long a session waits without progress before it starts over: longer each time, and from the first
// again where there is progress. Plain value.
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
  // Nothing is held against the destination any more.
  void Reset() {
    delay_ = first_;
    refusals_ = 0;
    has_started_over_at_once_ = false;
  }

  // The destination could not store a batch.
  void NoteRefusal() { ++refusals_; }
  void ForgetRefusals() { refusals_ = 0; }
  // It refused what was sent, and refused it again after a pause.
  bool is_refused_again() const { return refusals_ > 1; }
  // A batch was acknowledged. Pieces are acknowledged by a destination, too, that cannot store what they make up: after
  // a refusal only records are progress.
  void NoteProgress(bool has_records) {
    if (has_records || refusals_ == 0) Reset();
  }
  // A destination that has forgotten the session is answered at once, but only once until there is progress: the delay
  // is for trouble that lasts. True where it is that once.
  bool TakeStartAtOnce() { return !std::exchange(has_started_over_at_once_, true); }

 private:
  Duration first_;
  Duration longest_;
  Duration delay_;
  int refusals_ = 0;
  bool has_started_over_at_once_ = false;
};

}  // namespace moondb
