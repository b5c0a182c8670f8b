#include "actors/merge/gather_pool.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>

namespace moondb {
namespace {

TEST(GatherPoolTest, EachThreadRunsOncePerCall) {
  GatherPool pool(4);
  EXPECT_EQ(pool.thread_count(), 4);
  for (int round = 0; round < 100; ++round) {
    std::array<std::atomic<int>, 4> calls{};
    pool.Run([&calls](int worker) { ++calls[static_cast<std::size_t>(worker)]; });
    for (const std::atomic<int>& count : calls) EXPECT_EQ(count, 1);
  }
}

TEST(GatherPoolTest, APoolOfOneRunsOnTheCallersThread) {
  GatherPool pool(1);
  const auto caller = std::this_thread::get_id();
  pool.Run([caller](int worker) {
    EXPECT_EQ(worker, 0);
    EXPECT_EQ(std::this_thread::get_id(), caller);
  });
}

TEST(GatherPoolTest, TheNumberOfHardwareThreadsIsBounded) {
  EXPECT_GE(HardwareThreads(), 1);
  EXPECT_LE(HardwareThreads(), 16);
}

}  // namespace
}  // namespace moondb
