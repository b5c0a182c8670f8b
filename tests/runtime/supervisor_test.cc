#include "runtime/supervisor.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(SupervisorTest, FirstRestartIsImmediateAndFurtherOnesBackOff) {
  Supervisor supervisor({.restarts_max = 5});
  const MonotonicTime now{};
  EXPECT_EQ(supervisor.OnFailure(now), Duration::zero());
  EXPECT_EQ(supervisor.OnFailure(now), milliseconds(100));
  EXPECT_EQ(supervisor.OnFailure(now), milliseconds(200));
  EXPECT_EQ(supervisor.OnFailure(now), milliseconds(400));
  EXPECT_EQ(supervisor.OnFailure(now), milliseconds(800));
  EXPECT_EQ(supervisor.OnFailure(now), std::nullopt);
}

TEST(SupervisorTest, DelayHasALimit) {
  Supervisor supervisor({.restarts_max = 100, .delay_max = milliseconds(500)});
  for (int i = 0; i < 99; ++i) supervisor.OnFailure({});
  EXPECT_EQ(supervisor.OnFailure({}), milliseconds(500));
}

TEST(SupervisorTest, FailuresAreForgottenAfterThePeriod) {
  Supervisor supervisor({.restarts_max = 1, .restart_period = seconds(60)});
  MonotonicTime now{};
  EXPECT_EQ(supervisor.OnFailure(now), Duration::zero());
  now += seconds(59);
  EXPECT_EQ(supervisor.OnFailure(now), std::nullopt);
  now += seconds(1);
  EXPECT_EQ(supervisor.OnFailure(now), Duration::zero());
}

TEST(SupervisorTest, NoRestartsMeansNone) {
  Supervisor supervisor({.restarts_max = 0});
  EXPECT_EQ(supervisor.OnFailure({}), std::nullopt);
}

}  // namespace
}  // namespace moondb
