#include "apps/moondb_sim/budget_checker.h"

#include <gtest/gtest.h>

namespace moondb::simulation {
namespace {

using std::chrono::seconds;

TEST(BudgetCheckerTest, AllowsTheBudgetAndABurstAndNoMore) {
  BudgetChecker checker(/*bytes_per_second=*/2000, /*burst_bytes=*/64 * 1024);
  MonotonicTime now{};
  EXPECT_FALSE(checker.OnBatch(64 * 1024, now)) << "a burst";
  for (int second = 1; second <= 60; ++second) EXPECT_FALSE(checker.OnBatch(2000, now + seconds(second)));
  EXPECT_TRUE(checker.OnBatch(1, now + seconds(60)));
  EXPECT_FALSE(checker.OnBatch(2000, now + seconds(61))) << "the burst is a minute ago";
  EXPECT_FALSE(checker.OnBatch(60'000, now + seconds(61)));
  EXPECT_TRUE(checker.OnBatch(10'000, now + seconds(61)));
}

}  // namespace
}  // namespace moondb::simulation
