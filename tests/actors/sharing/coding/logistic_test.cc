#include "actors/sharing/coding/logistic.h"

#include <gtest/gtest.h>

#include <cmath>

namespace moondb {
namespace {

TEST(LogisticTest, SquashFollowsTheLogisticFunction) {
  for (int logit = -kLogitMax; logit <= kLogitMax; ++logit) {
    const double p = kProbabilityOne / (1 + std::exp(-logit / 256.0));
    ASSERT_NEAR(Squash(logit), p, 1.5) << logit;
  }
}

TEST(LogisticTest, SquashNeverReturnsZeroOrOne) {
  for (const int logit : {-1'000'000, -kLogitMax - 1, -kLogitMax, kLogitMax, kLogitMax + 1, 1'000'000}) {
    EXPECT_GT(Squash(logit), 0) << logit;
    EXPECT_LT(Squash(logit), kProbabilityOne) << logit;
  }
}

TEST(LogisticTest, StretchUndoesSquash) {
  for (int logit = -1500; logit <= 1500; ++logit) {
    // The largest error of Stretch in logit units. The table of Stretch has one entry per 16 probabilities.
    const double step = 16.0 / (Squash(logit) * (1 - Squash(logit) / 65536.0)) * 256;
    ASSERT_NEAR(Stretch(Squash(logit)), logit, step + 1) << logit;
  }
}

TEST(LogisticTest, StretchNeverDecreases) {
  for (int p = 1; p < kProbabilityOne; ++p) ASSERT_GE(Stretch(p), Stretch(p - 1)) << p;
}

}  // namespace
}  // namespace moondb
