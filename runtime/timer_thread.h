// TimerThread: runs tasks at their due times on one thread, which sleeps until the next due time.
//
// Tasks must be short, because a late task delays the following ones. Any thread may call Add and Cancel, also inside a
// task.
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
  // Removes the task. Has no effect on a task that has already started, and does not wait for the end of that task.
  void Cancel(TimerId id);
  // Waits for the running task and drops all other tasks. Must not be called from a task. Idempotent.
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
