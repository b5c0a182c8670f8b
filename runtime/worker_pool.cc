#include "runtime/worker_pool.h"

#include <pthread.h>

#include <utility>

#include "model/check.h"

namespace moondb {
namespace {

// Maximum number of successive turns of tasks from a thread's next slot (worker_pool.h). After that many turns, the
// thread takes a task from the queue.
constexpr int kSlotTurnsMax = 64;
// Number of yields before a thread without work sleeps. With 5 yields, two actors on dedicated threads answer each
// other 8 times as fast as with none (measured). More yields gain little.
constexpr int kYieldsBeforeSleep = 5;

}  // namespace

struct WorkerPool::Worker {
  static thread_local Worker* current;  // Worker of this thread; null on threads outside any pool.

  const WorkerPool* pool = nullptr;
  Runnable* next = nullptr;
  int slot_turns = 0;
  Ticks now = 0;  // End time of the last turn.
};

thread_local WorkerPool::Worker* WorkerPool::Worker::current = nullptr;

WorkerPool::WorkerPool(const std::string& name, int thread_count, std::function<void()> on_thread_start)
    : on_thread_start_(std::move(on_thread_start)) {
  Check(thread_count >= 1, "a pool has at least one thread");
  for (int i = 0; i < thread_count; ++i) {
    threads_.emplace_back([this] { Run(); });
    pthread_setname_np(threads_.back().native_handle(), name.substr(0, 15).c_str());
  }
}

void WorkerPool::Submit(Runnable* task) {
  Worker* worker = Worker::current;
  if (worker != nullptr && worker->pool == this && worker->next == nullptr) {
    worker->next = task;
  } else {
    SubmitLast(task);
  }
}

void WorkerPool::SubmitLast(Runnable* task) {
  {
    const std::lock_guard lock(mutex_);
    if (is_joining_) return;
    tasks_.push_back(task);
    has_tasks_.store(true, std::memory_order_relaxed);
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
  if (on_thread_start_) on_thread_start_();
  Worker worker;
  worker.pool = this;
  Worker::current = &worker;
  worker.now = TickClock::Now();
  while (Runnable* task = Next(worker)) worker.now = task->RunTurn(worker.now);
  Worker::current = nullptr;
}

Runnable* WorkerPool::Next(Worker& worker) {
  if (worker.next != nullptr && ++worker.slot_turns <= kSlotTurnsMax) return std::exchange(worker.next, nullptr);
  worker.slot_turns = 0;
  YieldWithoutWork(kYieldsBeforeSleep);
  std::unique_lock lock(mutex_);
  if (is_joining_) return nullptr;
  if (worker.next != nullptr) {
    tasks_.push_back(std::exchange(worker.next, nullptr));
    if (tasks_.size() > 1) changed_.notify_one();
  }
  changed_.wait(lock, [this] { return is_joining_ || !tasks_.empty(); });
  if (is_joining_) return nullptr;
  Runnable* task = tasks_.front();
  tasks_.pop_front();
  has_tasks_.store(!tasks_.empty(), std::memory_order_relaxed);
  worker.now = TickClock::Now();
  return task;
}

void WorkerPool::YieldWithoutWork(int times) const {
  if (Worker::current->next != nullptr) return;
  for (int i = 0; i < times && !has_tasks_.load(std::memory_order_relaxed); ++i) std::this_thread::yield();
}

}  // namespace moondb
