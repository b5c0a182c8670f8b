#include "apps/moondb_mission/random.h"

#include <gtest/gtest.h>

#include <cmath>

namespace moondb {
namespace {

constexpr int kDraws = 200'000;

TEST(RandomTest, DrawsTheSameNumbersInEveryVersion) {
  Random random(1);
  EXPECT_EQ(random.Uniform(), 0.13387664401253263);  // First number of std::mt19937_64 with seed 1, divided by 2^64.
  EXPECT_NE(Random::Stream(1, 1).Uniform(), Random::Stream(1, 2).Uniform());
  EXPECT_NE(Random::Stream(1, 1).Uniform(), Random::Stream(2, 1).Uniform());
}

TEST(RandomTest, DistributionsHaveTheirMoments) {
  Random random(7);
  double uniform = 0, normal = 0, normal_squared = 0, exponential = 0, poisson = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double u = random.Uniform(2, 4);
    ASSERT_TRUE(u >= 2 && u < 4);
    uniform += u;
    const double n = random.Normal();
    normal += n;
    normal_squared += n * n;
    exponential += random.Exponential(1.5);
  }
  for (int i = 0; i < 2000; ++i) poisson += random.Poisson(100);
  EXPECT_NEAR(uniform / kDraws, 3, 0.01);
  EXPECT_NEAR(normal / kDraws, 0, 0.01);
  EXPECT_NEAR(normal_squared / kDraws, 1, 0.02);
  EXPECT_NEAR(exponential / kDraws, 1.5, 0.02);
  EXPECT_NEAR(poisson / 2000, 100, 1);
}

}  // namespace
}  // namespace moondb
