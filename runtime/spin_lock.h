// SpinLock: a lock that is held for some nanoseconds at a time, and so mostly free again before a thread could be put
// to sleep.
//
// Two threads that pass messages at full speed meet at the mailbox's lock again and again; sleeping and waking at each
// meeting costs them half of their throughput, and one that wakes into a crowd (eight senders, two cores) sends the
// next to sleep (measured). Who finds it held looks a few times more, then yields the processor, which the holder may
// need. Nothing waits, allocates much or calls foreign code under it.
#pragma once

#include <atomic>
#include <thread>

namespace moondb {

class SpinLock {
 public:
  void lock() {
    while (is_held_.exchange(true, std::memory_order_acquire)) WaitUntilFree();
  }
  void unlock() { is_held_.store(false, std::memory_order_release); }

 private:
  // The holder may have been put to sleep, by as many senders as there are: then looking longer only takes its
  // processor. 10 in place of 100 bring eight senders on two cores 1.25 times as far, and cost one sender nothing
  // (docs/benchmarks/runtime.md); a look is a pause of 66 cycles on AMD's Zen 3, and of some 140 on Intel's Skylake.
  static constexpr int kLooksBeforeYield = 10;

  void WaitUntilFree() const {
    for (int looks = 0; is_held_.load(std::memory_order_relaxed); ++looks) {
      if (looks >= kLooksBeforeYield) std::this_thread::yield();
#if defined(__x86_64__)
      __builtin_ia32_pause();
#elif defined(__aarch64__)
      asm volatile("isb");
#endif
    }
  }

  std::atomic<bool> is_held_ = false;
};

}  // namespace moondb
