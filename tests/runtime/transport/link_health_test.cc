#include "runtime/transport/link_health.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Step = LinkHealth::Step;

class LinkHealthTest : public ::testing::Test {
 protected:
  LinkHealthTest() {
    health_.OnOpened(now_);
    health_.OnHeard(now_);
  }

  // Advances the time to the next deadline. Returns the step that is due at that time.
  Step Next(Duration patience = Duration::zero()) {
    if (health_.deadline(patience) > now_) {
      now_ = health_.deadline(patience);
      EXPECT_EQ(health_.Check(now_ - milliseconds(1), patience), Step::kNone);
    }
    return health_.Check(now_, patience);
  }

  Duration SinceStart() const { return now_ - start_; }
  void Expect(bool has_unreported, bool is_blocked = false) { health_.Expect(now_, has_unreported, is_blocked); }

  LinkHealth health_{{.ask_after = seconds(1), .lost_after = seconds(3), .keep_alive_after = seconds(30)}};
  const MonotonicTime start_{seconds(1000)};
  MonotonicTime now_ = start_;
};

TEST_F(LinkHealthTest, AsksAnIdlePeerRarely) {
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(SinceStart(), seconds(30));
  health_.OnHeard(now_);
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(SinceStart(), seconds(60));
}

TEST_F(LinkHealthTest, GivesUpAnIdlePeerThatDoesNotAnswer) {
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(Next(), Step::kLost);
  EXPECT_EQ(SinceStart(), seconds(33));
}

TEST_F(LinkHealthTest, AsksAndThenGivesUpWhileBytesAreUnreported) {
  now_ += seconds(10);
  Expect(/*has_unreported=*/true);
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(SinceStart(), seconds(11));
  EXPECT_EQ(Next(), Step::kLost);
  EXPECT_EQ(SinceStart(), seconds(13));
}

TEST_F(LinkHealthTest, WaitsLongerForTheFirstAnswerThanForTheNextOnes) {
  health_.OnOpened(now_);
  Expect(/*has_unreported=*/true);
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(SinceStart(), seconds(1));
  now_ += seconds(13);
  health_.OnHeard(now_);
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(Next(), Step::kLost);
  EXPECT_EQ(SinceStart(), seconds(17));

  health_.OnOpened(now_);
  Expect(/*has_unreported=*/true);
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(Next(), Step::kLost);
  EXPECT_EQ(SinceStart(), seconds(17 + 15));
}

TEST_F(LinkHealthTest, ContinuousSendingDoesNotDelayTheCheck) {
  for (int i = 0; i < 29; ++i, now_ += milliseconds(100)) {
    Expect(/*has_unreported=*/true);
    EXPECT_EQ(health_.Check(now_, Duration::zero()), i == 10 ? Step::kAsk : Step::kNone) << i;
  }
  EXPECT_EQ(Next(), Step::kLost);
  EXPECT_EQ(SinceStart(), seconds(3));
}

TEST_F(LinkHealthTest, AnyMessageRestartsTheWait) {
  Expect(/*has_unreported=*/true);
  EXPECT_EQ(Next(), Step::kAsk);
  now_ += milliseconds(500);
  health_.OnHeard(now_);
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(SinceStart(), milliseconds(2500));
  EXPECT_EQ(Next(), Step::kLost);
  EXPECT_EQ(SinceStart(), milliseconds(4500));
}

TEST_F(LinkHealthTest, ExpectsNoReportOnceAllBytesAreReported) {
  Expect(/*has_unreported=*/true);
  EXPECT_EQ(Next(), Step::kAsk);
  health_.OnProgress(now_);
  Expect(/*has_unreported=*/false);
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(SinceStart(), seconds(31));
}

TEST_F(LinkHealthTest, DetectsAPeerThatSendsButReportsNothing) {
  Expect(/*has_unreported=*/true, /*is_blocked=*/true);
  std::vector<Step> steps;
  for (; steps.empty() || steps.back() != Step::kStalled; now_ += milliseconds(100)) {
    ASSERT_LT(SinceStart(), seconds(10));
    health_.OnHeard(now_);
    if (const Step step = health_.Check(now_, Duration::zero()); step != Step::kNone) steps.push_back(step);
  }
  EXPECT_EQ(steps, (std::vector<Step>{Step::kAsk, Step::kStalled}));
  EXPECT_EQ(SinceStart(), milliseconds(3100));
}

TEST_F(LinkHealthTest, ProgressRestartsTheWaitForCredit) {
  Expect(/*has_unreported=*/true, /*is_blocked=*/true);
  EXPECT_EQ(Next(), Step::kAsk);
  now_ += seconds(1);
  health_.OnProgress(now_);
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(SinceStart(), seconds(3));
  health_.OnProgress(now_);
  Expect(/*has_unreported=*/true, /*is_blocked=*/false);
  health_.OnHeard(now_ += seconds(1));
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(SinceStart(), seconds(5));
}

TEST_F(LinkHealthTest, WaitsLongerWhileALargeFrameIsInFlight) {
  Expect(/*has_unreported=*/true);
  EXPECT_EQ(Next(seconds(10)), Step::kAsk);
  EXPECT_EQ(Next(seconds(10)), Step::kLost);
  EXPECT_EQ(SinceStart(), seconds(13));
}

TEST_F(LinkHealthTest, AllowsThePeerItsTimeToAnswerALateQuestion) {
  Expect(/*has_unreported=*/true);
  now_ += seconds(20);  // The process was stopped for 20 s and then continued.
  EXPECT_EQ(Next(), Step::kAsk);
  EXPECT_EQ(Next(), Step::kLost);
  EXPECT_EQ(SinceStart(), seconds(22));
}

}  // namespace
}  // namespace moondb
