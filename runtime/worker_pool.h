// WorkerPool: threads that run tasks in the order in which they were submitted, and sleep when there are none.
//
// One queue under one mutex: with a handful of actors and short handlers the lock is rarely contended, and an idle
// agent uses no battery. With one thread it is that thread's queue. Any thread may call Submit.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace moondb {

class WorkerPool {
 public:
  using Task = std::function<void()>;

  // `name` is what tools like top show; its first 15 bytes count.
  WorkerPool(const std::string& name, int thread_count);
  ~WorkerPool() { Join(); }

  // The number of waiting tasks is the caller's to bound. After Join: nothing happens.
  void Submit(Task task);

  // Lets running tasks end, drops waiting ones. Not from one of its own threads. Idempotent.
  void Join();

 private:
  void Run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Task> tasks_;
  bool is_joining_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace moondb
