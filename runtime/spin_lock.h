// SpinLock: a lock for sections of a few nanoseconds, such as a push into a mailbox. A thread that finds the lock held
// polls a few times and then yields its processor, which the holder may need. Sleeping and waking instead would halve
// the throughput of two threads that exchange messages at full speed (measured). Code under the lock must not wait,
// allocate much or call foreign code.
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
  // Number of polls before a thread yields its processor, which a preempted holder may need. With 10 polls instead of
  // 100, eight senders on two cores are 1.25 times as fast, at no cost for one sender (docs/benchmarks/runtime.md). One
  // poll pauses 66 cycles on AMD Zen 3 and about 140 on Intel Skylake.
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
