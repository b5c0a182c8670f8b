#include "actors/role/failover_actor.h"

#include <gtest/gtest.h>

#include "actors/lease/lease_actor.h"
#include "tests/actors/role/role_team.h"

namespace moondb {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

// Rover 1 is the leader, rover 2 the survivor, rover 3 has no role, and agent 4 is the base station. The survivor takes
// the lead if the leader is silent for 120 s.
class FailoverActorTest : public testing::Test, protected RoleTeam {
 protected:
  FailoverActorTest() : RoleTeam(/*seed=*/1) {
    config_.mutable_roles()->set_failover(proto::FAILOVER_AUTOMATIC);
    config_.mutable_roles()->set_leader_timeout_s(120);
    config_.mutable_radio()->set_quiet_while_driving(true);
  }

  void StartWithFailover() {
    Start();
    for (const AgentId agent : Agents()) {
      LeaseActor::Options lease;
      lease.self = agent;
      lease.team = config_;
      team_.Spawn(agent, actor_name::kLease, [lease] { return std::make_unique<LeaseActor>(lease); });
      FailoverActor::Options failover;
      failover.self = agent;
      failover.team = config_;
      team_.Spawn(agent, actor_name::kFailover, [failover] { return std::make_unique<FailoverActor>(failover); });
    }
    team_.AdvanceTime(seconds(10));
  }

  void SetLease(AgentId agent, proto::LeaseKind kind, double duration_s) {
    proto::Message message;
    message.mutable_lease_request()->set_kind(kind);
    message.mutable_lease_request()->set_seconds(duration_s);
    (void)team_.Post({agent, actor_name::kGateway}, {agent, actor_name::kLease}, message);
    team_.AdvanceTime(std::chrono::milliseconds(10));
  }

  // Cuts the links between `agent` and all other agents, and notifies both ends of each link.
  void Lose(AgentId agent) {
    for (const AgentId other : Agents()) {
      if (other != agent) team_.SetLink(agent, other, false);
    }
  }

  // From now on, adds each leader check to `checks_`: "2?1" if agent 2 checks agent 1, "1!2" if agent 1 replies.
  void CountChecks() {
    team_.SetFilter([this](AgentId from, AgentId to, const proto::Message& message) {
      if (message.has_leader_check()) {
        checks_ += std::to_string(from) + (message.leader_check().is_reply() ? "!" : "?") + std::to_string(to) + " ";
      }
      return true;
    });
  }

  std::string checks_;

  AgentId LeaderAsKnownTo(AgentId agent) { return Show(agent).roles().leader(); }
};

TEST_F(FailoverActorTest, OnlyTheSurvivorTakesTheLeadAndNamesAConnectedRover) {
  StartWithFailover();
  Lose(1);
  team_.AdvanceTime(seconds(119));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
  team_.AdvanceTime(seconds(2));
  for (const AgentId agent : {2, 3, 4}) {
    SCOPED_TRACE(agent);
    const proto::RoleAssignment roles = Show(agent).roles();
    EXPECT_EQ(roles.leader(), 2u);
    EXPECT_EQ(roles.survivor(), 3u);
    EXPECT_EQ(roles.term().issuer(), 2u);
    EXPECT_EQ(roles.reason(), "failover: agent1 was silent for 120 s");
  }
}

TEST_F(FailoverActorTest, TheDeposedLeaderStepsDownWhenItReconnects) {
  StartWithFailover();
  Lose(1);
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(LeaderAsKnownTo(1), 1u) << "two leaders, in two parts of the team";
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
  team_.Heal();
  team_.AdvanceTime(seconds(2));
  EXPECT_TRUE(AllAgree());
  EXPECT_EQ(LeaderAsKnownTo(1), 2u);
  team_.AdvanceTime(minutes(60));
  EXPECT_EQ(LeaderAsKnownTo(1), 2u) << "nobody changes it again";
}

TEST_F(FailoverActorTest, TheNextSurvivorReplacesTheNextLeader) {
  StartWithFailover();
  Lose(1);
  team_.AdvanceTime(minutes(10));
  Lose(2);
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(LeaderAsKnownTo(3), 3u);
}

TEST_F(FailoverActorTest, DoesNotNameALostRoverSurvivorIfAnotherIsConnected) {
  config_.mutable_agents(3)->set_kind(proto::AGENT_KIND_ROVER);
  StartWithFailover();
  Lose(3);
  Lose(1);
  team_.AdvanceTime(minutes(3));
  EXPECT_EQ(Show(2).roles().survivor(), 4u);
}

TEST_F(FailoverActorTest, NamesTheLostLeaderSurvivorIfThereIsNoOtherRover) {
  config_.mutable_agents(2)->set_kind(proto::AGENT_KIND_BASE_STATION);
  config_.mutable_agents()->RemoveLast();
  StartWithFailover();
  Lose(1);
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(Show(2).roles().leader(), 2u);
  EXPECT_EQ(Show(2).roles().survivor(), 1u);
}

TEST_F(FailoverActorTest, ReplacesALeaderThatHasLeftThoughItWasNeverHeard) {
  config_.mutable_agents(0)->set_left(true);
  Lose(1);
  StartWithFailover();
  Lose(1);
  team_.AdvanceTime(minutes(3));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
  EXPECT_EQ(Show(2).roles().survivor(), 3u);
}

TEST_F(FailoverActorTest, DoesNotNameAnAgentThatHasLeftSurvivor) {
  config_.mutable_agents(2)->set_left(true);  // Rover 3 has left the team. Rovers 1 and 2 remain.
  StartWithFailover();
  Lose(3);
  Lose(1);
  team_.AdvanceTime(minutes(3));
  EXPECT_EQ(Show(2).roles().leader(), 2u);
  EXPECT_EQ(Show(2).roles().survivor(), 1u) << "the lost leader rather than one that has left";
}

TEST_F(FailoverActorTest, DoesNothingWhenFailoverIsManual) {
  config_.mutable_roles()->set_failover(proto::FAILOVER_MANUAL);
  StartWithFailover();
  Lose(1);
  team_.AdvanceTime(minutes(60));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
}

TEST_F(FailoverActorTest, WaitsWhileTheLeaderSleepsAndOneTimeoutMore) {
  StartWithFailover();
  SetLease(1, proto::LEASE_KIND_SLEEPING, 3600);
  Lose(1);
  team_.AdvanceTime(seconds(3600 + 119));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

TEST_F(FailoverActorTest, WaitsWhileLeaderOrSurvivorDrives) {
  StartWithFailover();
  SetLease(1, proto::LEASE_KIND_DRIVING, 300);
  Lose(1);
  team_.AdvanceTime(seconds(200));
  SetLease(2, proto::LEASE_KIND_DRIVING, 300);
  team_.AdvanceTime(seconds(300 + 119));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

TEST_F(FailoverActorTest, APausedLeaderThatIsLostIsReplacedAndOneThatAnswersIsNot) {
  StartWithFailover();
  SetLease(1, proto::LEASE_KIND_PAUSED, 3600);
  SetLease(2, proto::LEASE_KIND_PAUSED, 3600);
  team_.AdvanceTime(minutes(30));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u) << "it answers";
  Lose(1);
  team_.AdvanceTime(seconds(119));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

TEST_F(FailoverActorTest, DrivingDoesNotDelayFailoverWithoutRadioSilence) {
  config_.mutable_radio()->set_quiet_while_driving(false);
  StartWithFailover();
  SetLease(1, proto::LEASE_KIND_DRIVING, 3600);
  Lose(1);
  team_.AdvanceTime(seconds(121));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

TEST_F(FailoverActorTest, ALeaderThatIsHeardOccasionallyStays) {
  StartWithFailover();
  for (int i = 0; i < 20; ++i) {
    team_.SetLink(1, 2, false);
    team_.AdvanceTime(seconds(100));
    team_.SetLink(1, 2, true);
    team_.AdvanceTime(seconds(1));
  }
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
}

TEST_F(FailoverActorTest, DoesNotReplaceALeaderThatItNeverHeard) {
  StartWithFailover();
  Lose(1);
  team_.Crash(2);
  team_.Restart(2);
  team_.AdvanceTime(minutes(60));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
  team_.Heal();
  team_.AdvanceTime(seconds(10));
  Lose(1);
  team_.AdvanceTime(seconds(121));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

TEST_F(FailoverActorTest, DoesNotReplaceASleepingLeaderAfterARestart) {
  StartWithFailover();
  SetLease(1, proto::LEASE_KIND_SLEEPING, 36000);
  Lose(1);
  team_.Crash(2);
  team_.AdvanceTime(seconds(10));
  team_.Restart(2);
  team_.AdvanceTime(minutes(60));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
  team_.CrashActor({2, actor_name::kFailover});
  team_.AdvanceTime(minutes(60));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
}

TEST_F(FailoverActorTest, DoesNotReplaceASleepingLeaderWhenItsLeaseIsForgotten) {
  StartWithFailover();
  SetLease(1, proto::LEASE_KIND_SLEEPING, 36000);
  Lose(1);
  team_.AdvanceTime(seconds(10));
  team_.CrashActor({2, actor_name::kLease});
  team_.AdvanceTime(minutes(60));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
}

TEST_F(FailoverActorTest, ASurvivorThatReachesNoAgentDoesNotTakeTheLead) {
  StartWithFailover();
  Lose(2);
  team_.AdvanceTime(minutes(60));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
  team_.SetLink(2, 4, true);
  team_.AdvanceTime(seconds(121));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

TEST_F(FailoverActorTest, TheSurvivorChecksTheLeaderThreeTimesPerTimeout) {
  StartWithFailover();
  CountChecks();
  team_.AdvanceTime(seconds(120));
  EXPECT_EQ(checks_, "2?1 1!2 2?1 1!2 2?1 1!2 ");
}

TEST_F(FailoverActorTest, ALeaderInRadioSilenceIsNotChecked) {
  StartWithFailover();
  SetLease(1, proto::LEASE_KIND_SLEEPING, 600);
  CountChecks();
  team_.AdvanceTime(seconds(599));
  EXPECT_EQ(checks_, "");
  SetLease(2, proto::LEASE_KIND_DRIVING, 600);
  team_.AdvanceTime(seconds(599));
  EXPECT_EQ(checks_, "");
  team_.AdvanceTime(seconds(42));
  EXPECT_EQ(checks_, "2?1 1!2 ");
}

TEST_F(FailoverActorTest, AReconnectedLeaderIsChecked) {
  StartWithFailover();
  CountChecks();
  team_.SetLink(1, 2, false);
  team_.AdvanceTime(seconds(100));
  EXPECT_EQ(checks_, "");
  team_.SetLink(1, 2, true);
  team_.AdvanceTime(seconds(41));
  EXPECT_EQ(checks_, "2?1 1!2 ");
}

TEST_F(FailoverActorTest, NoAgentChecksTheLeaderIfFailoverIsManual) {
  config_.mutable_roles()->set_failover(proto::FAILOVER_MANUAL);
  StartWithFailover();
  CountChecks();
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(checks_, "");
}

TEST_F(FailoverActorTest, OnlyTheSurvivorsChecksAreAnswered) {
  StartWithFailover();
  CountChecks();
  proto::Message question;
  question.mutable_leader_check();
  (void)team_.Post({3, actor_name::kFailover}, {1, actor_name::kFailover}, question);
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(checks_, "3?1 ");
}

TEST_F(FailoverActorTest, TakesTheLeadOnlyIfTheRolesAreStillTheSame) {
  StartWithFailover();
  Lose(1);
  team_.RecordSent({2, actor_name::kFailover});
  team_.AdvanceTime(seconds(121));
  const auto sent = team_.TakeSent({2, actor_name::kFailover});
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(sent.back().role_set_request().expected().leader(), 1u);
  EXPECT_EQ(sent.back().role_set_request().expected().survivor(), 2u);
  EXPECT_EQ(sent.back().role_set_request().expected().term().number(), 1u);
}

TEST_F(FailoverActorTest, TheSurvivorOfATeamOfTwoLeadsAlone) {
  config_.mutable_agents()->RemoveLast();
  config_.mutable_agents()->RemoveLast();
  StartWithFailover();
  Lose(1);
  team_.AdvanceTime(seconds(121));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

TEST_F(FailoverActorTest, RestartsTheTimeoutForAnotherLeader) {
  StartWithFailover();
  Lose(1);
  Lose(3);
  team_.AdvanceTime(seconds(100));
  proto::RoleSetRequest request;
  request.set_leader(3);
  Set(2, request);
  team_.AdvanceTime(seconds(119));
  EXPECT_EQ(LeaderAsKnownTo(2), 3u);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

TEST_F(FailoverActorTest, ASurvivorActsOnceItsRoleIsDurable) {
  StartWithFailover();
  disks_[1]->is_failing = true;
  Swap(2);
  team_.AdvanceTime(seconds(10));
  Lose(2);
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(LeaderAsKnownTo(3), 2u) << "agent 1 is to survive, and cannot store it";
  disks_[1]->is_failing = false;
  team_.AdvanceTime(seconds(135));
  EXPECT_EQ(LeaderAsKnownTo(3), 1u);
}

TEST_F(FailoverActorTest, TriesAgainWhenTheRolesCouldNotBeStored) {
  StartWithFailover();
  disks_[2]->is_failing = true;
  Lose(1);
  team_.AdvanceTime(seconds(130));
  EXPECT_EQ(LeaderAsKnownTo(2), 1u);
  disks_[2]->is_failing = false;
  team_.AdvanceTime(seconds(120));
  EXPECT_EQ(LeaderAsKnownTo(2), 2u);
}

}  // namespace
}  // namespace moondb
