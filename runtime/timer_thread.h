// TimerThread: runs tasks at their time, on one thread that sleeps until the next is due.
//
// Tasks are short: a late one delays those behind it. Any thread may call Add and Cancel, tasks too.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "runtime/timer_queue.h"

namespace moondb {

class TimerThread {
 public:
  using Task = std::function<void()>;

  TimerThread();
  ~TimerThread() { Join(); }

  TimerId Add(MonotonicTime due, Task task);
  // The task has run, is running, or will never run.
  void Cancel(TimerId id);
  // Lets a running task end, drops all others. Not from a task. Idempotent.
  void Join();

 private:
  void Run();

  std::mutex mutex_;
  std::condition_variable changed_;
  TimerQueue<Task> queue_;
  bool is_joining_ = false;
  std::thread thread_;
};

}  // namespace moondb
