#include "apps/moonctl/settled.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

class SettledTest : public testing::Test {
 protected:
  SettledTest() {
    for (std::uint32_t id = 1; id <= 2; ++id) {
      proto::AgentConfig& agent = *team_.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
      activity_.sharing.emplace_back(id, proto::ShareStatus());
    }
    activity_.registration.set_is_done(true);
  }

  std::string Why() const { return WhyNotSettled(team_, activity_); }

  proto::TeamConfig team_;
  TeamActivity activity_;
};

TEST_F(SettledTest, SaysWhatStillMoves) {
  EXPECT_EQ(Why(), "");
  activity_.graph.set_is_due(true);
  EXPECT_EQ(Why(), "a solve of the pose graph is due");
  activity_.graph.set_is_solving(true);
  EXPECT_EQ(Why(), "the leader is solving the pose graph");
  activity_.sharing[0].second.add_gathers_from(2);
  EXPECT_EQ(Why(), "rover1 is still fetching the records of rover2");
  activity_.sharing[0].second.add_due(2);
  EXPECT_EQ(Why(), "rover1 has records to send to rover2");
  proto::ShareSession& session = *activity_.sharing[0].second.add_sessions();
  session.set_destination(2);
  EXPECT_EQ(Why(), "rover1 has records to send to rover2") << "a closed session";
  session.set_is_open(true);
  EXPECT_EQ(Why(), "rover1 is sending records to rover2, which has not answered yet");
  session.set_is_remaining_known(true);
  session.set_remaining(45);
  EXPECT_EQ(Why(), "rover1 is sending records to rover2, 45 left");
}

TEST_F(SettledTest, NamesAnAgentThatIsAwayOnceTheOthersHaveSettled) {
  activity_.away = {2};
  activity_.sharing.pop_back();
  activity_.sharing[0].second.add_due(2);
  activity_.sharing[0].second.add_gathers_from(2);
  proto::ShareSession& session = *activity_.sharing[0].second.add_sessions();
  session.set_destination(2);
  session.set_is_open(true);
  EXPECT_EQ(Why(), "rover2 does not answer; the other agents have settled");
  activity_.graph.set_is_due(true);
  EXPECT_EQ(Why(), "a solve of the pose graph is due");
}

TEST_F(SettledTest, WaitsForMatchingUnlessNothingIsMatched) {
  activity_.registration.set_is_due(true);
  EXPECT_EQ(Why(), "the leader is matching maps");
  activity_.registration.set_is_done(false);
  EXPECT_EQ(Why(), "the leader is matching maps");
  activity_.registration.set_text("registration is off");
  EXPECT_EQ(Why(), "");
}

}  // namespace
}  // namespace moondb
