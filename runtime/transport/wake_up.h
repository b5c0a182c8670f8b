// WakeUp: a file descriptor with which any thread can wake one sleeping thread.
//
// The sleeper announces until when it will sleep. Other threads make the descriptor readable (they ring) only for work
// that is due earlier. They do not ring while the thread is awake or if the work is due later.
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

  // For the sleeper. The sleeper calls IsLooking before it computes its deadline, SleepsUntil with the result, and
  // IsAwake after it wakes (`by_file`: woken by RingFor). Until IsAwake, RingFor rings for anything earlier than the
  // announced time.
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
