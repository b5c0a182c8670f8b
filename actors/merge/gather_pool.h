// GatherPool: a few threads that stay, for work in many like parts. The thread that asks works too, and waits.
//
// Threads sleep between calls. They are not pinned: an agent shares its machine with the robot's own software, and only
// the system knows which processor is free.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace moondb {

// What the machine has, 1 to 16.
int HardwareThreads();

class GatherPool {
 public:
  // So many threads work in all, the asking one included; 1 starts none.
  explicit GatherPool(int threads);
  ~GatherPool();
  GatherPool(const GatherPool&) = delete;
  GatherPool& operator=(const GatherPool&) = delete;

  int thread_count() const { return static_cast<int>(helpers_.size()) + 1; }

  // Calls `work(worker)` once on each thread, worker 0 being the caller's, and returns when all have returned. One
  // call at a time.
  void Run(const std::function<void(int worker)>& work);

 private:
  void Help(int worker);

  std::vector<std::thread> helpers_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable done_;
  const std::function<void(int)>* work_ = nullptr;  // Guarded by mutex_, like all below.
  std::uint64_t round_ = 0;
  int busy_ = 0;
  bool is_ending_ = false;
};

}  // namespace moondb
