#include "actors/storage/clock_judge.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

using std::chrono::hours;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr AgentId kBase = 4;
constexpr std::int64_t kUtc_ns = 1'767'225'600'000'000'000;  // Start of 2026-01-01 (UTC).

class ClockJudgeTest : public testing::Test {
 protected:
  // Reports a clock of `peer` to `judge_`. The clock is `ahead` of the true time.
  void Hear(AgentId peer, nanoseconds ahead = {}) { judge_.ObservePeer(peer, Utc(ahead), now_); }
  ClockJudge::Verdict Judge(nanoseconds ahead = {}) { return judge_.Judge(Utc(ahead), now_); }
  bool IsSuspect(nanoseconds ahead = {}) { return !Judge(ahead).suspect.empty(); }
  std::int64_t Utc(nanoseconds ahead) const { return kUtc_ns + (now_ - start_ + ahead).count(); }

  ClockJudge judge_{kBase};
  const ClockJudge::Time start_{seconds(1000)};
  ClockJudge::Time now_ = start_;
};

TEST_F(ClockJudgeTest, TrustsAPlausibleClockThatNoPeerContradicts) {
  EXPECT_FALSE(IsSuspect());
  now_ += hours(100);
  EXPECT_FALSE(IsSuspect());
  EXPECT_FALSE(Judge().has_jumped);
}

TEST_F(ClockJudgeTest, SuspectsAClockThatWasNeverSet) {
  EXPECT_EQ(judge_.Judge(3'000'000'000, now_).suspect, "it was never set");
  EXPECT_EQ(judge_.Judge(-1, now_).suspect, "it was never set");
  EXPECT_EQ(judge_.Judge(INT64_MAX, now_).suspect, "it was never set");
  const ClockJudge::Verdict set = Judge();
  EXPECT_EQ(set.suspect, "") << "set since";
  EXPECT_TRUE(set.has_jumped) << "others are notified";
}

TEST_F(ClockJudgeTest, SuspectsAClockThatIsOffMostOfTheTeam) {
  Hear(2);
  EXPECT_FALSE(IsSuspect(hours(3))) << "one against one";
  Hear(3, seconds(20));
  const std::string why = Judge(hours(3)).suspect;
  EXPECT_EQ(why, "it is more than a minute off the clocks of 2 other agents");
  EXPECT_TRUE(IsSuspect(-hours(3)));
  EXPECT_FALSE(IsSuspect(seconds(30)));
}

TEST_F(ClockJudgeTest, TheBaseStationsClockBreaksATie) {
  Hear(kBase);
  EXPECT_TRUE(IsSuspect(hours(3)));
  Hear(2, hours(3));
  EXPECT_FALSE(IsSuspect(hours(3))) << "two rovers against the base station";
  Hear(3);
  EXPECT_TRUE(IsSuspect(hours(3))) << "two against two";
}

TEST_F(ClockJudgeTest, ExtrapolatesThePeersClocks) {
  Hear(2);
  Hear(3);
  now_ += hours(50);
  EXPECT_FALSE(IsSuspect());
  EXPECT_TRUE(IsSuspect(-hours(50)));
}

TEST_F(ClockJudgeTest, IgnoresPeersWhoseClockWasNeverSet) {
  Hear(2, -hours(24 * 365 * 50));
  Hear(3, -hours(24 * 365 * 50));
  judge_.ObservePeer(kBase, INT64_MIN, now_);
  EXPECT_FALSE(IsSuspect());
}

TEST_F(ClockJudgeTest, SuspectsAJumpUntilAnotherClockAgreesOrItJumpsBack) {
  EXPECT_FALSE(IsSuspect());
  const ClockJudge::Verdict jumped = Judge(hours(2));
  EXPECT_TRUE(jumped.has_jumped);
  EXPECT_EQ(jumped.suspect, "it jumped by 7200 s, and no other agent's clock agrees");
  EXPECT_FALSE(Judge(hours(2)).has_jumped);
  EXPECT_TRUE(IsSuspect(hours(2)));
  EXPECT_FALSE(IsSuspect());
  EXPECT_TRUE(IsSuspect(hours(2)));
  Hear(2, hours(2));
  EXPECT_FALSE(IsSuspect(hours(2))) << "it was wrong before";
}

}  // namespace
}  // namespace moondb
