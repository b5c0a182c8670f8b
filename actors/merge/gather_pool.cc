#include "actors/merge/gather_pool.h"

#include <algorithm>

namespace moondb {

int HardwareThreads() { return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 16); }

GatherPool::GatherPool(int threads) {
  for (int worker = 1; worker < threads; ++worker) helpers_.emplace_back([this, worker] { Help(worker); });
}

GatherPool::~GatherPool() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  wake_.notify_all();
  for (std::thread& helper : helpers_) helper.join();
}

void GatherPool::Run(const std::function<void(int worker)>& work) {
  if (helpers_.empty()) return work(0);
  {
    const std::lock_guard lock(mutex_);
    work_ = &work;
    busy_ = static_cast<int>(helpers_.size());
    ++round_;
  }
  wake_.notify_all();
  work(0);
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return busy_ == 0; });
}

void GatherPool::Help(int worker) {
  std::uint64_t last_round = 0;
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [&] { return is_ending_ || round_ != last_round; });
    if (is_ending_) return;
    last_round = round_;
    const std::function<void(int)>& work = *work_;
    lock.unlock();
    work(worker);
    lock.lock();
    if (--busy_ == 0) done_.notify_one();
  }
}

}  // namespace moondb
