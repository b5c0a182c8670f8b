// HandlerTimes measures how long the handlers of one actor run. PingTimes measures how long an actor waits for its
// turn.
//
// Threads other than the actor's may call only the functions that are marked as thread-safe.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "runtime/one_writer.h"
#include "runtime/tick_clock.h"

namespace moondb {

class HandlerTimes {
 public:
  // A handler that takes longer than `limit` is an overrun.
  explicit HandlerTimes(Ticks limit) : limit_(limit) {}

  // Call when the actor's OnStart begins. OnStart is not timed and has no limit; only begun() is set.
  void OnStart(Ticks now) { begun_ = now; }
  void OnBegun(Ticks now) {
    begun_ = now;
    running_since_.store(now, std::memory_order_relaxed);
  }
  // Returns the duration of the handler that ended.
  Ticks OnEnded(Ticks now) {
    running_since_.store(0, std::memory_order_relaxed);
    const Ticks took = std::max<Ticks>(0, now - begun_);
    Increase(total_, took);
    if (took > longest_.load(std::memory_order_relaxed)) longest_ = took;
    if (IsOverrun(took)) Increase(overruns_, 1);
    return took;
  }
  bool IsOverrun(Ticks took) const { return took > limit_; }
  Ticks begun() const { return begun_; }  // Start of the current handler or OnStart.

  // The following functions are thread-safe.
  Ticks running_since() const { return running_since_.load(std::memory_order_relaxed); }  // 0: no handler is running.
  Ticks total() const { return total_; }
  Ticks longest() const { return longest_; }
  std::uint64_t overruns() const { return overruns_; }

 private:
  const Ticks limit_;
  Ticks begun_ = 0;
  std::atomic<Ticks> running_since_ = 0;
  std::atomic<Ticks> total_ = 0;
  std::atomic<Ticks> longest_ = 0;
  std::atomic<std::uint64_t> overruns_ = 0;
};

class PingTimes {
 public:
  // Call OnSent before a Ping is sent, and OnRefused if the mailbox refused that Ping. Thread-safe.
  void OnSent(Ticks now) { waiting_since_ = now; }
  void OnRefused() { waiting_since_ = 0; }
  Ticks waiting_since() const { return waiting_since_; }  // 0: no Ping waits. Thread-safe.
  // How long the last answered Ping waited; negative if none was answered yet. Thread-safe.
  Ticks last() const { return last_; }

  // Call on the actor's thread only.
  void OnAnswered(Ticks now) { last_ = std::max<Ticks>(0, now - waiting_since_.exchange(0)); }

 private:
  std::atomic<Ticks> waiting_since_ = 0;
  std::atomic<Ticks> last_ = -1;
};

}  // namespace moondb
