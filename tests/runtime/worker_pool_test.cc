#include "runtime/worker_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <latch>
#include <string>
#include <utility>
#include <vector>

namespace moondb {
namespace {

using testing::ElementsAre;

class Task final : public Runnable {
 public:
  explicit Task(std::function<void()> work) : work_(std::move(work)) {}
  Ticks RunTurn(Ticks now) override {
    work_();
    return now;
  }

 private:
  const std::function<void()> work_;
};

TEST(WorkerPoolTest, ATasksFirstSubmissionRunsNextOnItsThreadAndTheOthersLast) {
  WorkerPool pool("test", /*thread_count=*/1);
  std::vector<std::string> order;
  std::latch is_gathered(1);
  std::latch is_done(4);
  const auto note = [&](const std::string& name) {
    order.push_back(name);
    is_done.count_down();
  };
  Task reply([&] { note("reply"); });
  Task later([&] { note("later"); });
  Task waiting([&] { note("waiting"); });
  Task first([&] {
    is_gathered.wait();
    note("first");
    pool.Submit(&reply);
    pool.Submit(&later);
  });
  pool.Submit(&first);
  pool.Submit(&waiting);
  is_gathered.count_down();
  is_done.wait();
  pool.Join();
  EXPECT_THAT(order, ElementsAre("first", "reply", "waiting", "later"));
}

TEST(WorkerPoolTest, TwoTasksThatKeepSubmittingEachOtherLetOthersRun) {
  WorkerPool pool("test", /*thread_count=*/1);
  std::latch has_run(1);
  std::atomic<bool> is_over = false;
  Task* other = nullptr;
  Task ping([&] {
    if (!is_over) pool.Submit(other);
  });
  Task pong([&] {
    if (!is_over) pool.Submit(&ping);
  });
  other = &pong;
  Task third([&] { has_run.count_down(); });
  pool.Submit(&ping);
  pool.Submit(&third);
  has_run.wait();
  is_over = true;
  pool.Join();
}

TEST(WorkerPoolTest, AJoinedPoolRunsNoMoreTasks) {
  WorkerPool pool("test", /*thread_count=*/2);
  pool.Join();
  Task never([] { ADD_FAILURE() << "it ran"; });
  pool.Submit(&never);
  pool.Join();
}

}  // namespace
}  // namespace moondb
