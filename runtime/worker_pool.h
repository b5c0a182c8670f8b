// WorkerPool: threads that run submitted tasks in order and sleep if there are none.
//
// The pool has one queue under one mutex. A thread without work yields its processor a few times (1 to 3 us in all)
// before it sleeps. A steady stream of work then avoids the cost of sleeping and waking.
//
// The first task that a pool's own thread submits during a turn waits in the thread's next slot, which holds one task,
// and runs right after the turn, without a lock or a wake-up. A turn that submits a task and then continues for long
// delays that task, so actors with long turns need a dedicated thread.
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
  // Runs one turn. `now` is the start time of the turn. Returns its end time, which saves a clock read between two
  // turns.
  virtual Ticks RunTurn(Ticks now) = 0;
};

class WorkerPool {
 public:
  // `name` is the name of the threads in tools like top; only its first 15 bytes count. `on_thread_start` runs first on
  // each thread.
  WorkerPool(const std::string& name, int thread_count, std::function<void()> on_thread_start = {});
  ~WorkerPool() { Join(); }

  // Submits a task. Requires: the task is not already waiting in the pool, and it exists until its turn ends. Has no
  // effect after Join. Thread-safe.
  void Submit(Runnable* task);
  // Adds the task like Submit, but always behind all waiting tasks. For a task that just had its turn.
  void SubmitLast(Runnable* task);

  // Yields the processor up to `times` times, as long as no work waits in the pool. Call only inside a turn.
  void YieldWithoutWork(int times) const;

  // Waits for running turns and drops waiting tasks. Must not be called from the pool's own threads. Idempotent.
  void Join();

 private:
  struct Worker;

  void Run();
  Runnable* Next(Worker& worker);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Runnable*> tasks_;
  std::atomic<bool> has_tasks_ = false;  // True if tasks_ is not empty. Read without the lock by threads that yield.
  bool is_joining_ = false;
  std::vector<std::thread> threads_;
  const std::function<void()> on_thread_start_;
};

}  // namespace moondb
