#include "runtime/quiet_timer.h"

#include <gmock/gmock.h>

#include "runtime/simulation/simulated_team.h"
#include "tests/runtime/scripted_actor.h"

namespace moondb {
namespace {

using simulation::SimulatedTeam;
using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::IsEmpty;

class QuietTimerTest : public testing::Test {
 protected:
  static constexpr AgentId kSelf = 1;
  static constexpr std::uint32_t kKind = 5;
  static inline const Address kActor{kSelf, "actor"};

  // Starts an actor that takes each message as news. due_ are the seconds at which its work was due.
  void Start(QuietTimer::Options options) {
    options.kind = kKind;
    timer_.emplace(options);
    team_.AddAgent(kSelf);
    begin_ = team_.now();
    team_.Spawn(kSelf, kActor.actor, OnEachMessage([this](Context& context, const proto::Message& message) {
                  if (message.has_custom()) return timer_->OnNews(context);
                  if (timer_->OnTimer(context, is_busy_)) {
                    due_.push_back(std::chrono::duration_cast<std::chrono::seconds>(context.now() - begin_).count());
                  }
                }));
  }
  void News() {
    proto::Message message;
    message.mutable_custom();
    ASSERT_EQ(team_.Post({kSelf, "test"}, kActor, std::move(message)), SendResult::kAccepted);
    team_.RunUntilIdle();
  }
  void Wait(int duration_s) { team_.AdvanceTime(std::chrono::seconds(duration_s)); }

  std::optional<QuietTimer> timer_;
  std::vector<long> due_;
  bool is_busy_ = false;
  MonotonicTime begin_{};
  SimulatedTeam team_{/*seed=*/1};
};

TEST_F(QuietTimerTest, IsDueOnceNoNewsHasArrivedForAWhile) {
  Start({.quiet = 2s});
  News();
  Wait(1);
  News();
  Wait(1);
  News();
  Wait(1);
  EXPECT_THAT(due_, IsEmpty());
  Wait(10);
  EXPECT_THAT(due_, ElementsAre(4));
  News();
  Wait(10);
  EXPECT_THAT(due_, ElementsAre(4, 15));
}

TEST_F(QuietTimerTest, ASteadyStreamOfNewsDelaysItForALimitedTime) {
  Start({.quiet = 2s, .wait_max = 10s});
  for (int i = 0; i < 15; ++i) {
    News();
    Wait(1);
  }
  ASSERT_FALSE(due_.empty());
  EXPECT_LE(due_.front(), 11);
}

TEST_F(QuietTimerTest, KeepsAPauseBetweenTwoWorks) {
  Start({.quiet = 2s, .apart = 20s});
  News();
  Wait(5);
  News();
  Wait(60);
  EXPECT_THAT(due_, ElementsAre(2, 22));
}

TEST_F(QuietTimerTest, IsNotDueForNewsBeforeAStop) {
  Start({.quiet = 2s});
  News();
  Wait(1);
  timer_->Stop();
  EXPECT_FALSE(timer_->has_news());
  Wait(10);
  EXPECT_THAT(due_, IsEmpty());
  News();  // After 11 s.
  Wait(1);
  timer_->Stop();
  News();
  EXPECT_TRUE(timer_->has_news());
  Wait(10);
  EXPECT_THAT(due_, ElementsAre(14)) << "2 s after the last news, and once";
}

TEST_F(QuietTimerTest, WaitsWhileTheActorIsBusy) {
  Start({.quiet = 2s});
  is_busy_ = true;
  News();
  Wait(11);
  EXPECT_THAT(due_, IsEmpty());
  is_busy_ = false;
  Wait(5);
  EXPECT_THAT(due_, ElementsAre(12));
}

}  // namespace
}  // namespace moondb
