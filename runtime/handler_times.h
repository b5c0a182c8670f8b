// HandlerTimes: how long the handlers of one actor run, and PingTimes: how long it takes until it has its turn.
//
// The actor's thread writes; any thread reads what says so.
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

  // OnStart begins: it has a beginning, and no limit.
  void OnStart(Ticks now) { begun_ = now; }
  void OnBegun(Ticks now) {
    begun_ = now;
    running_since_.store(now, std::memory_order_relaxed);
  }
  // How long it took.
  Ticks OnEnded(Ticks now) {
    running_since_.store(0, std::memory_order_relaxed);
    const Ticks took = std::max<Ticks>(0, now - begun_);
    Increase(total_, took);
    if (took > longest_.load(std::memory_order_relaxed)) longest_ = took;
    if (IsOverrun(took)) Increase(overruns_, 1);
    return took;
  }
  bool IsOverrun(Ticks took) const { return took > limit_; }
  Ticks begun() const { return begun_; }  // The present handler, or OnStart.

  // Any thread.
  Ticks running_since() const { return running_since_.load(std::memory_order_relaxed); }  // 0: in no handler.
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
  // Any thread: a Ping is sent, or was refused.
  void OnSent(Ticks now) { waiting_since_ = now; }
  void OnRefused() { waiting_since_ = 0; }
  Ticks waiting_since() const { return waiting_since_; }  // 0: none waits.
  Ticks last() const { return last_; }                    // How long the last one waited; negative: none was answered.

  // The actor's thread.
  void OnAnswered(Ticks now) { last_ = std::max<Ticks>(0, now - waiting_since_.exchange(0)); }

 private:
  std::atomic<Ticks> waiting_since_ = 0;
  std::atomic<Ticks> last_ = -1;
};

}  // namespace moondb
