#include "runtime/worker_pool.h"

#include <pthread.h>

#include <utility>

#include "model/check.h"

namespace moondb {

WorkerPool::WorkerPool(const std::string& name, int thread_count) {
  Check(thread_count >= 1, "a pool has at least one thread");
  for (int i = 0; i < thread_count; ++i) {
    threads_.emplace_back([this] { Run(); });
    pthread_setname_np(threads_.back().native_handle(), name.substr(0, 15).c_str());
  }
}

void WorkerPool::Submit(Task task) {
  {
    const std::lock_guard lock(mutex_);
    if (is_joining_) return;
    tasks_.push_back(std::move(task));
  }
  changed_.notify_one();
}

void WorkerPool::Join() {
  {
    const std::lock_guard lock(mutex_);
    is_joining_ = true;
    tasks_.clear();
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) {
    Check(thread.get_id() != std::this_thread::get_id(), "no thread of a pool waits for itself");
    thread.join();
  }
  threads_.clear();
}

void WorkerPool::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return is_joining_ || !tasks_.empty(); });
    if (is_joining_) return;
    const Task task = std::move(tasks_.front());
    tasks_.pop_front();
    lock.unlock();
    task();
    lock.lock();
  }
}

}  // namespace moondb
