#include "actors/sharing/flow_schedule.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

class FlowScheduleTest : public testing::Test {
 protected:
  FlowScheduleTest() {
    schedule_.SetDestinations({1, 2}, now_);
    for (const AgentId agent : {1, 2}) states_[agent] = {.is_ready = true, .is_busy = false, .has_refused = false};
    (void)Take();
  }

  std::vector<AgentId> Take() {
    return schedule_.TakeDue(now_, [this](AgentId agent) { return states_.at(agent); });
  }
  std::optional<FlowSchedule::Time> Deadline() {
    return schedule_.deadline([this](AgentId agent) { return states_.at(agent); });
  }
  void Note(AgentId noted) {
    schedule_.Note([noted](AgentId agent) { return agent == noted; });
  }

  FlowSchedule::Time now_{};
  FlowSchedule schedule_{seconds(5)};
  std::map<AgentId, FlowSchedule::State> states_;
};

TEST_F(FlowScheduleTest, ServesADestinationAtOnceButOnceAPeriod) {
  now_ += seconds(20);
  Note(1);
  EXPECT_THAT(Take(), ElementsAre(1));
  now_ += seconds(1);
  Note(1);
  EXPECT_THAT(Take(), IsEmpty());
  EXPECT_EQ(Deadline(), now_ + seconds(4));
  now_ += seconds(4);
  EXPECT_THAT(Take(), ElementsAre(1));
  now_ += seconds(10);
  EXPECT_THAT(Take(), IsEmpty()) << "nothing is new";
}

TEST_F(FlowScheduleTest, NeverServesAnythingWithoutAPeriod) {
  FlowSchedule off{seconds(0)};
  off.SetDestinations({1}, now_);
  off.Note([](AgentId) { return true; });
  const auto state_of = [this](AgentId agent) { return states_.at(agent); };
  EXPECT_THAT(off.TakeDue(now_ + minutes(10), state_of), IsEmpty());
  EXPECT_EQ(off.deadline(state_of), std::nullopt);
}

TEST_F(FlowScheduleTest, ADestinationThatIsNotReadyWaitsWithoutATimerAndDelaysNobody) {
  now_ += seconds(20);
  states_[1].is_ready = false;
  Note(1);
  Note(2);
  EXPECT_THAT(Take(), ElementsAre(2));
  EXPECT_EQ(Deadline(), FlowSchedule::Time() + minutes(1)) << "the next full round";
  EXPECT_THAT(schedule_.FindDue(), ElementsAre(1));
  now_ += seconds(3);
  states_[1].is_ready = true;
  EXPECT_THAT(Take(), ElementsAre(1));
  EXPECT_THAT(schedule_.FindDue(), IsEmpty());
}

TEST_F(FlowScheduleTest, WaitsForAnOrderThatIsBeingCarriedOut) {
  now_ += seconds(20);
  states_[1].is_busy = true;
  Note(1);
  EXPECT_THAT(Take(), IsEmpty());
  now_ += seconds(5);
  states_[1].is_busy = false;
  EXPECT_THAT(Take(), ElementsAre(1));
}

TEST_F(FlowScheduleTest, ServesADestinationThatRefusesMoreAndMoreRarely) {
  now_ += minutes(2);
  (void)Take();
  states_[1].has_refused = true;
  std::vector<seconds> waits;
  for (FlowSchedule::Time last = now_; waits.size() < 9; now_ += seconds(1)) {
    Note(1);
    if (!testing::Matches(testing::Contains(1u))(Take())) continue;
    waits.push_back(std::chrono::duration_cast<seconds>(now_ - last));
    last = now_;
  }
  EXPECT_THAT(waits, ElementsAre(seconds(10), seconds(20), seconds(40), seconds(80), seconds(160), seconds(320),
                                 seconds(600), seconds(600), seconds(600)));
  EXPECT_THAT(schedule_.FindRefusing(), ElementsAre(1));
  states_[1].has_refused = false;
  now_ += minutes(20);
  Note(1);
  EXPECT_THAT(Take(), testing::Contains(1u));
  now_ += seconds(5);
  Note(1);
  EXPECT_THAT(Take(), ElementsAre(1)) << "it takes records again";
  EXPECT_THAT(schedule_.FindRefusing(), testing::IsEmpty());
}

TEST_F(FlowScheduleTest, ServesAllOnceAMinuteInCaseAnEventWasMissed) {
  EXPECT_EQ(Deadline(), now_ + minutes(1));
  now_ += minutes(1);
  EXPECT_THAT(Take(), ElementsAre(1, 2));
  EXPECT_EQ(Deadline(), now_ + minutes(1));
}

TEST_F(FlowScheduleTest, NewDestinationsAreDueAndOldOnesKeepTheirPeriod) {
  schedule_.SetDestinations({2, 3}, now_);
  states_[3] = states_[2];
  EXPECT_THAT(Take(), ElementsAre(3));
  now_ += seconds(5);
  EXPECT_THAT(Take(), ElementsAre(2));
}

}  // namespace
}  // namespace moondb
