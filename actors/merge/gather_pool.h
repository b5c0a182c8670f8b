// GatherPool: a few permanent threads for work that splits into many similar parts. The calling thread works as well
// and waits for the other threads. Threads sleep between calls. Threads are not pinned to processors, because the
// robot's own software runs on the same machine.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace moondb {

// Returns the number of hardware threads, limited to the range from 1 to 16.
int HardwareThreads();

class GatherPool {
 public:
  // `threads` counts the calling thread too; 1 starts no thread.
  explicit GatherPool(int threads);
  ~GatherPool();
  GatherPool(const GatherPool&) = delete;
  GatherPool& operator=(const GatherPool&) = delete;

  int thread_count() const { return static_cast<int>(helpers_.size()) + 1; }

  // Calls `work(worker)` once on each thread and returns when all these calls have returned. Worker 0 is the calling
  // thread. Run must not be called by two threads simultaneously.
  void Run(const std::function<void(int worker)>& work);

 private:
  void Help(int worker);

  std::vector<std::thread> helpers_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable done_;
  const std::function<void(int)>* work_ = nullptr;  // Guarded by mutex_, like all members below.
  std::uint64_t round_ = 0;
  int busy_ = 0;
  bool is_ending_ = false;
};

}  // namespace moondb
