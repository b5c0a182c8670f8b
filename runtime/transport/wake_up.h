// WakeUp: a file that any thread makes readable, for one thread that sleeps on it.
//
// The sleeper says until when it means to sleep; whoever has something for an earlier time rings. So an awake thread is
// never rung for, and a deadline that lies behind the next look costs nothing.
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

  // Any thread, after what it announces can be seen: there is something to be done at `due` (by default now).
  void RingFor(MonotonicTime due = MonotonicTime::min());

  // The sleeper: before it looks when it has to wake, then with the answer, and when it is awake again (by the file, or
  // otherwise). Until IsAwake it is rung for anything earlier than what it said.
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
