#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "bench/in_process.h"
#include "bench/tally.h"
#include "runtime/actor.h"

namespace moondb {
namespace {

class BareQueue {
 public:
  void Push(std::uint64_t id) {
    std::unique_lock lock(mutex_);
    has_room_.wait(lock, [this] { return ids_.size() < kMax; });
    ids_.push_back(id);
    if (ids_.size() == 1) has_ids_.notify_one();
  }

  // Waits until at least one number is in the queue, then takes all of them.
  void TakeAll(std::deque<std::uint64_t>* ids) {
    std::unique_lock lock(mutex_);
    has_ids_.wait(lock, [this] { return !ids_.empty(); });
    if (ids_.size() == kMax) has_room_.notify_all();
    ids->swap(ids_);
  }

 private:
  static constexpr std::size_t kMax = 4096;  // The default of SpawnOptions::messages_max.

  std::mutex mutex_;
  std::condition_variable has_ids_;
  std::condition_variable has_room_;
  std::deque<std::uint64_t> ids_;
};

class Node {
 public:
  virtual ~Node() = default;
  virtual Node* Handle(std::uint64_t left) = 0;
};

class RingNode final : public Node {
 public:
  Node* Handle(std::uint64_t left) override { return left == 0 ? nullptr : next; }
  Node* next = nullptr;
};

class Signal {
 public:
  void Give() {
    const std::lock_guard lock(mutex_);
    is_given_ = true;
    changed_.notify_one();
  }

  void Take() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return is_given_; });
    is_given_ = false;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_given_ = false;
};

Result<double> FanIn(int sender_count, std::uint64_t count) {
  const std::uint64_t per_sender = count / static_cast<std::uint64_t>(sender_count);
  const std::uint64_t total = per_sender * static_cast<std::uint64_t>(sender_count);
  Tally tally(sender_count, per_sender);
  BareQueue queue;
  const auto start = BenchClock::now();
  std::thread reader([&] {
    std::deque<std::uint64_t> ids;
    for (std::uint64_t taken = 0; taken < total; taken += ids.size()) {
      ids.clear();
      queue.TakeAll(&ids);
      for (const std::uint64_t id : ids) tally.Count(id);
    }
  });
  RunSenders(sender_count, [&](int sender) {
    for (std::uint64_t number = 0; number < per_sender; ++number) queue.Push(Tally::IdOf(sender, number));
  });
  const Result<void> done = tally.Wait();
  const auto took = BenchClock::now() - start;
  reader.join();
  if (!done) return tl::unexpected(done.error());
  return PerSecond(total, took);
}

// Returns hops per second around a ring of objects on the heap.
double Calls(int object_count, std::uint64_t count) {
  std::vector<std::unique_ptr<RingNode>> nodes;
  for (int i = 0; i < object_count; ++i) nodes.push_back(std::make_unique<RingNode>());
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes[i]->next = nodes[(i + 1) % nodes.size()].get();
  const auto start = BenchClock::now();
  Node* node = nodes.front().get();
  for (std::uint64_t left = count; node != nullptr; --left) {
    asm volatile("" : "+r"(node));  // Hides from the compiler which object `node` points to.
    node = node->Handle(left);
  }
  return PerSecond(count, BenchClock::now() - start);
}

// Measures round trips between two threads. Each direction has its own mutex and condition variable.
Result<double> Handover(std::uint64_t count) {
  Signal there;
  Signal back;
  std::thread other([&] {
    for (std::uint64_t i = 0; i < count; ++i) {
      there.Take();
      back.Give();
    }
  });
  const auto start = BenchClock::now();
  for (std::uint64_t i = 0; i < count; ++i) {
    there.Give();
    back.Take();
  }
  const auto took = BenchClock::now() - start;
  other.join();
  return MicrosecondsEach(count, took);
}

}  // namespace

InProcess LimitInProcess() {
  return {FanIn, [](std::uint64_t count) { return Result<double>(Calls(2, count)); },
          [](std::uint64_t count) { return Result<double>(Calls(kRingActors, count)); },
          [](std::uint64_t count) { return Result<double>(2e6 / Calls(2, 2 * count)); }, Handover};
}

}  // namespace moondb
