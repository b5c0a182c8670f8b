#include "runtime/timer_thread.h"

#include <pthread.h>

#include <utility>

namespace moondb {

TimerThread::TimerThread() : thread_([this] { Run(); }) { pthread_setname_np(thread_.native_handle(), "timers"); }

TimerId TimerThread::Add(MonotonicTime due, Task task) {
  TimerId id = 0;
  bool is_first = false;
  {
    const std::lock_guard lock(mutex_);
    id = queue_.Add(due, std::move(task));
    is_first = queue_.NextDue() == due;
  }
  if (is_first) changed_.notify_one();
  return id;
}

void TimerThread::Cancel(TimerId id) {
  const std::lock_guard lock(mutex_);
  queue_.Cancel(id);
}

void TimerThread::Join() {
  {
    const std::lock_guard lock(mutex_);
    is_joining_ = true;
  }
  changed_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void TimerThread::Run() {
  std::unique_lock lock(mutex_);
  while (!is_joining_) {
    auto due = queue_.TakeDue(std::chrono::steady_clock::now());
    if (due) {
      lock.unlock();
      due->second();
      due.reset();
      lock.lock();
    } else if (const auto next = queue_.NextDue()) {
      changed_.wait_until(lock, *next);
    } else {
      changed_.wait(lock);
    }
  }
}

}  // namespace moondb
