#include "apps/moondb_sim/failover_checker.h"

#include <gtest/gtest.h>

namespace moondb::simulation {
namespace {

using std::chrono::seconds;

constexpr MonotonicTime kStart(seconds(1000));
constexpr AgentId kLeader = 1;
constexpr AgentId kSurvivor = 2;
constexpr AgentId kThird = 3;

proto::TeamConfig Team() {
  proto::TeamConfig team;
  for (AgentId id = 1; id <= 3; ++id) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(id);
    agent.set_name("rover" + std::to_string(id));
    agent.set_kind(proto::AGENT_KIND_ROVER);
  }
  team.mutable_roles()->set_leader("rover1");
  team.mutable_roles()->set_survivor("rover2");
  team.mutable_roles()->set_failover(proto::FAILOVER_AUTOMATIC);
  team.mutable_roles()->set_leader_timeout_s(120);
  return team;
}

class FailoverCheckerTest : public testing::Test {
 protected:
  FailoverCheckerTest() {
    SetConnected(kLeader, true, 0);
    SetConnected(kThird, true, 0);
  }

  std::optional<std::string> Handle(const char* actor, const proto::Message& message, int at_s) {
    leases_.OnHandle(actor, message, At(at_s));
    return checker_.OnHandle(actor, message, leases_, At(at_s));
  }
  void SetConnected(AgentId peer, bool is_connected, int at_s) {
    proto::Message message;
    message.mutable_peer_event()->set_peer(peer);
    message.mutable_peer_event()->set_is_connected(is_connected);
    (void)Handle(actor_name::kFailover, message, at_s);
  }
  void SetRoles(AgentId leader, AgentId survivor, int at_s) {
    proto::Message message;
    message.set_hop_sender(kSurvivor);
    proto::RoleAssignment& roles = *message.mutable_roles_changed()->mutable_roles();
    roles.set_leader(leader);
    roles.set_survivor(survivor);
    roles.mutable_term()->set_number(++term_);
    (void)Handle(actor_name::kFailover, message, at_s);
  }
  // The survivor takes the lead at `at_s`. Returns the violation, or "" if there is none.
  std::string TakeLead(int at_s) {
    proto::Message timer;
    timer.mutable_timer();
    (void)Handle(actor_name::kFailover, timer, at_s);
    proto::Message request;
    request.set_hop_sender(kSurvivor);
    request.mutable_role_set_request()->set_leader(kSurvivor);
    request.mutable_role_set_request()->set_reason("failover: rover1 was silent for 120 s");
    return Handle(actor_name::kRole, request, at_s).value_or("");
  }
  bool IsOverdue(int at_s) const { return checker_.WhyOverdue(leases_, At(at_s)).has_value(); }
  static MonotonicTime At(int at_s) { return kStart + seconds(at_s); }

  const proto::TeamConfig team_ = Team();
  std::uint64_t term_ = 0;
  LeaseChecker leases_{kSurvivor};
  FailoverChecker checker_{kSurvivor, team_, kStart};
};

TEST_F(FailoverCheckerTest, SurvivorHasCauseWhenTheLeaderIsLostForLong) {
  EXPECT_EQ(TakeLead(1000), "the leader is connected");
  SetConnected(kLeader, false, 1000);
  EXPECT_EQ(TakeLead(1119), "the leader was connected a moment ago");
  EXPECT_EQ(TakeLead(1120), "");
}

TEST_F(FailoverCheckerTest, ItIsOverdueUntilItTakesTheLead) {
  SetConnected(kLeader, false, 1000);
  EXPECT_FALSE(IsOverdue(1130));
  EXPECT_TRUE(IsOverdue(1140));
  EXPECT_EQ(TakeLead(1140), "");
  EXPECT_FALSE(IsOverdue(1150));
  EXPECT_TRUE(IsOverdue(1300)) << "nothing came of it, and it does not ask again";
}

TEST_F(FailoverCheckerTest, OthersHaveNoCause) {
  SetRoles(kLeader, kThird, 10);
  SetConnected(kLeader, false, 20);
  EXPECT_EQ(TakeLead(1000), "it is not the survivor");
  EXPECT_FALSE(IsOverdue(1000));
}

TEST_F(FailoverCheckerTest, NewRolesBeginToCount) {
  SetConnected(kLeader, false, 20);
  SetConnected(kThird, false, 30);
  SetRoles(kThird, kSurvivor, 100);
  SetConnected(kLeader, true, 120);
  EXPECT_EQ(TakeLead(219), "the roles are new");
}

TEST_F(FailoverCheckerTest, LeaderThatWasHeardIsNotMissed) {
  SetConnected(kLeader, false, 0);
  proto::Message message;
  message.set_hop_sender(kLeader);
  (void)Handle(actor_name::kSync, message, 100);
  EXPECT_EQ(TakeLead(219), "the leader was heard a moment ago");
  EXPECT_EQ(TakeLead(220), "");
}

TEST_F(FailoverCheckerTest, LeaderThatSleepsIsNotMissed) {
  proto::Message message;
  message.set_hop_sender(kLeader);
  message.mutable_lease_announce()->set_number(5);
  message.mutable_lease_announce()->set_sleeping_s(600);
  (void)Handle(actor_name::kLease, message, 0);
  SetConnected(kLeader, false, 0);
  EXPECT_EQ(TakeLead(719), "the leader drives or sleeps, or did a moment ago");
  EXPECT_FALSE(IsOverdue(719));
  EXPECT_EQ(TakeLead(720), "");
}

TEST_F(FailoverCheckerTest, ASleepingSurvivorHasNoCause) {
  proto::Message message;
  message.set_hop_sender(kSurvivor);
  message.mutable_lease_request()->set_kind(proto::LEASE_KIND_SLEEPING);
  message.mutable_lease_request()->set_seconds(600);
  (void)Handle(actor_name::kLease, message, 0);
  SetConnected(kLeader, false, 0);
  EXPECT_EQ(TakeLead(719), "it drives or sleeps itself, or did a moment ago");
  EXPECT_EQ(TakeLead(720), "");
}

TEST_F(FailoverCheckerTest, NobodyHasCauseWhereOperatorsDecide) {
  proto::TeamConfig manual = Team();
  manual.mutable_roles()->set_failover(proto::FAILOVER_MANUAL);
  FailoverChecker checker(kSurvivor, manual, kStart);
  proto::Message timer;
  timer.mutable_timer();
  (void)checker.OnHandle(actor_name::kFailover, timer, leases_, At(1000));
  proto::Message request;
  request.mutable_role_set_request()->set_reason("failover: rover1 was silent for 120 s");
  EXPECT_EQ(checker.OnHandle(actor_name::kRole, request, leases_, At(1000)), "nobody is to do so by itself");
}

TEST_F(FailoverCheckerTest, AnAgentThatReachesNoPeerHasNoCause) {
  SetConnected(kLeader, false, 0);
  SetConnected(kThird, false, 10);
  EXPECT_EQ(TakeLead(500), "it reaches nobody");
  SetConnected(kThird, true, 500);
  EXPECT_EQ(TakeLead(619), "it reached nobody a moment ago");
  EXPECT_EQ(TakeLead(620), "");
}

TEST_F(FailoverCheckerTest, AnAgentThatForgotTheLeaderHasNoCause) {
  SetConnected(kLeader, false, 0);
  checker_.OnFailure(actor_name::kFailover, At(10));
  SetConnected(kThird, true, 10);
  EXPECT_EQ(TakeLead(1000), "the leader was never connected");
  EXPECT_FALSE(IsOverdue(1000));
}

}  // namespace
}  // namespace moondb::simulation
