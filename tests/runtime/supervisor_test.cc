#include "runtime/supervisor.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Action = Supervisor::Action;

constexpr double kNoJitter = 0.5;
const Error kFailure{ErrorCode::kInternal, "on purpose", {}};

TEST(SupervisorTest, TheFirstRestartIsImmediateAndLaterOnesBackOff) {
  Supervisor supervisor({.restarts_max = 5});
  const MonotonicTime now{};
  for (const int delay_ms : {0, 100, 200, 400, 800}) {
    const Supervisor::Verdict verdict = supervisor.OnFailure(kFailure, now, kNoJitter);
    EXPECT_EQ(verdict.action, Action::kRestart);
    EXPECT_EQ(verdict.delay, milliseconds(delay_ms));
  }
  EXPECT_EQ(supervisor.OnFailure(kFailure, now, kNoJitter).action, Action::kBeyondHelp);
}

TEST(SupervisorTest, DelayHasALimit) {
  Supervisor supervisor({.restarts_max = 100, .delay_max = milliseconds(500)});
  for (int i = 0; i < 99; ++i) supervisor.OnFailure(kFailure, {}, kNoJitter);
  EXPECT_EQ(supervisor.OnFailure(kFailure, {}, kNoJitter).delay, milliseconds(500));
}

TEST(SupervisorTest, JitterSpreadsDelays) {
  for (const auto& [jitter, delay] : {std::pair(0.0, 80), std::pair(0.5, 100), std::pair(1.0, 120)}) {
    Supervisor supervisor({.jitter_ratio = 0.2});
    EXPECT_EQ(supervisor.OnFailure(kFailure, {}, jitter).delay, Duration::zero());
    EXPECT_EQ(supervisor.OnFailure(kFailure, {}, jitter).delay, milliseconds(delay));
  }
}

TEST(SupervisorTest, FailuresAreForgottenAfterThePeriod) {
  Supervisor supervisor({.restarts_max = 1, .restart_period = seconds(60)});
  MonotonicTime now{};
  EXPECT_EQ(supervisor.OnFailure(kFailure, now, kNoJitter).delay, Duration::zero());
  now += seconds(59);
  EXPECT_EQ(supervisor.OnFailure(kFailure, now, kNoJitter).action, Action::kBeyondHelp);
  now += seconds(1);
  EXPECT_EQ(supervisor.OnFailure(kFailure, now, kNoJitter).delay, Duration::zero());
}

TEST(SupervisorTest, ZeroRestartsAllowNone) {
  Supervisor supervisor({.restarts_max = 0});
  EXPECT_EQ(supervisor.OnFailure(kFailure, {}, kNoJitter).action, Action::kBeyondHelp);
}

TEST(SupervisorTest, StepsDownBeforeItGivesUp) {
  Supervisor supervisor({.restarts_max = 3, .restart_period = seconds(60), .can_step_down = true});
  MonotonicTime now{};
  for (int i = 0; i < 3; ++i) EXPECT_EQ(supervisor.OnFailure(kFailure, now, kNoJitter).action, Action::kRestart);
  // After the step-down, the actor gets restarts_max further restarts, with long delays.
  Supervisor::Verdict verdict = supervisor.OnFailure(kFailure, now, kNoJitter);
  EXPECT_EQ(verdict.action, Action::kStepDown);
  int restarts = 1;
  for (; verdict.action != Action::kBeyondHelp && restarts < 100; ++restarts) {
    EXPECT_EQ(verdict.delay, seconds(10));
    now += verdict.delay;
    verdict = supervisor.OnFailure(kFailure, now, /*jitter=*/1);
    if (verdict.action == Action::kRestart) verdict.delay = seconds(10);
  }
  EXPECT_EQ(restarts, 4);
}

TEST(SupervisorTest, DamageOnDiskIsNotRetried) {
  Supervisor supervisor({.can_step_down = true});
  EXPECT_EQ(supervisor.OnFailure({ErrorCode::kCorrupt, "on purpose", {}}, {}, kNoJitter).action, Action::kBeyondHelp);
}

TEST(SupervisorTest, APeriodWithoutFailuresAllowsAnotherStepDown) {
  Supervisor supervisor({.restarts_max = 1, .restart_period = seconds(60), .can_step_down = true});
  MonotonicTime now{};
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(supervisor.OnFailure(kFailure, now, kNoJitter).action, Action::kRestart);
    EXPECT_EQ(supervisor.OnFailure(kFailure, now, kNoJitter).action, Action::kStepDown);
    EXPECT_EQ(supervisor.OnFailure(kFailure, now, kNoJitter).action, Action::kBeyondHelp);
    now += seconds(60);
  }
}

}  // namespace
}  // namespace moondb
