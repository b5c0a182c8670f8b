// WakeUp: a file descriptor with which any thread can wake one sleeping thread.
//
// The sleeping thread announces until when it will sleep. RingFor makes the descriptor readable only if the thread
// sleeps and the new work is due before that time.
#pragma once

#include <atomic>
#include <cstdint>

#include "runtime/actor.h"

namespace moondb {

class WakeUp {
 public:
  WakeUp();
  ~WakeUp();
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;

  // Announces work that is due at `due` (by default now). Requires: the work is already visible to the sleeper.
  // Thread-safe.
  void RingFor(MonotonicTime due = MonotonicTime::min());

  // The sleeping thread calls IsLooking before it computes its deadline, SleepsUntil with that deadline, and IsAwake
  // after it wakes. `by_file`: the descriptor was readable. Between IsLooking and SleepsUntil, RingFor makes the
  // descriptor readable for any work.
  void IsLooking() { sleeps_until_ = kAnyTime; }
  void SleepsUntil(MonotonicTime time) { sleeps_until_ = time.time_since_epoch().count(); }
  void IsAwake(bool by_file);

  int file() const { return file_; }

 private:
  static constexpr std::int64_t kAnyTime = INT64_MAX;
  static constexpr std::int64_t kAwake = INT64_MIN;

  const int file_;
  std::atomic<std::int64_t> sleeps_until_{kAwake};
  std::atomic<bool> is_ringing_{false};
};

}  // namespace moondb
