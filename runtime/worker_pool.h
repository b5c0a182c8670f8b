// WorkerPool: threads that run what was submitted, in that order, and sleep when there is nothing.
//
// One queue under one mutex, no stealing and no polling: with a handful of actors and short turns the lock is rarely
// contended, and an idle agent uses no battery. Before a thread that has worked sleeps, it yields the processor a few
// times (1 to 3 us in all): in a steady stream nobody pays for putting to sleep and waking. What one of the pool's own
// threads submits first in a turn waits in that thread's next slot instead and runs right after the turn, so that
// request and reply stay on one thread, in its cache, without a lock and without waking another. So a turn that submits
// and then goes on for long delays what it submitted: long turns belong on a thread of their own. With one thread the
// pool is that thread's queue.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "runtime/tick_clock.h"

namespace moondb {

class Runnable {
 public:
  virtual ~Runnable() = default;
  // `now` is the time at its start; returns the time at its end, which saves a look at the clock between two turns.
  virtual Ticks RunTurn(Ticks now) = 0;
};

class WorkerPool {
 public:
  // `name` is what tools like top show; its first 15 bytes count. `on_thread_start` runs first on each thread.
  WorkerPool(const std::string& name, int thread_count, std::function<void()> on_thread_start = {});
  ~WorkerPool() { Join(); }

  // Any thread. The caller submits one thing once until its turn began, which bounds the queue, and keeps it until its
  // turn ended. After Join: nothing happens.
  void Submit(Runnable* task);
  // As Submit, but behind all that waits: for what had its turn already.
  void SubmitLast(Runnable* task);

  // In a turn: lets others have the processor, up to so many times, unless other work waits in the pool.
  void YieldWithoutWork(int times) const;

  // Lets running turns end, drops waiting ones. Not from one of its own threads. Idempotent.
  void Join();

 private:
  struct Worker;

  void Run();
  Runnable* Next(Worker& worker);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Runnable*> tasks_;
  std::atomic<bool> has_tasks_ = false;  // Of tasks_, for who lingers.
  bool is_joining_ = false;
  std::vector<std::thread> threads_;
  const std::function<void()> on_thread_start_;
};

}  // namespace moondb
