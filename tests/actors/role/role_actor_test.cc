#include "actors/role/role_actor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <stdexcept>

#include "model/term.h"
#include "tests/actors/role/role_team.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

// Takes PgoActor's place. Adds the leader of each published role assignment to `leaders`.
class FakePgoActor final : public Actor {
 public:
  explicit FakePgoActor(std::shared_ptr<std::vector<AgentId>> leaders) : leaders_(std::move(leaders)) {}

  void OnStart(Context& context) override { context.Watch(Topic::kRoles); }
  void OnMessage(Context&, const proto::Message& message) override {
    if (message.has_roles_changed()) leaders_->push_back(message.roles_changed().roles().leader());
  }

 private:
  std::shared_ptr<std::vector<AgentId>> leaders_;
};

class RoleActorTest : public testing::Test, protected RoleTeam {
 protected:
  RoleActorTest() : RoleTeam(/*seed=*/1) {}

  // Returns the RolesChanged messages that `agent`'s sync actor has received since the last call, oldest first.
  std::vector<proto::RolesChanged> Notified(AgentId agent) {
    std::vector<proto::RolesChanged> reported;
    for (const proto::Message& message : team_.TakeMessages({agent, actor_name::kSync}))
      reported.push_back(message.roles_changed());
    return reported;
  }
};

TEST_F(RoleActorTest, AllAgreeOnTheTeamFilesRolesInTermOne) {
  StartAndSettle();
  EXPECT_TRUE(AllAgree());
  const auto shown = Show(4);
  EXPECT_EQ(shown.roles().leader(), 1u);
  EXPECT_EQ(shown.roles().survivor(), 2u);
  EXPECT_EQ(shown.roles().term().number(), 1u);
  EXPECT_EQ(shown.roles().reason(), "start of the leader");
  EXPECT_THAT(Show(1).confirmed_by(), testing::ElementsAre(1, 2, 3, 4));
}

TEST_F(RoleActorTest, NotifiesItsAgentsOtherActorsOfTheirRole) {
  StartAndSettle();
  EXPECT_EQ(Notified(1).back().own_role(), proto::ROLE_LEADER);
  EXPECT_EQ(Notified(2).back().own_role(), proto::ROLE_DESIGNATED_SURVIVOR);
  EXPECT_EQ(Notified(3).back().own_role(), proto::ROLE_ROVER);
  EXPECT_EQ(Notified(4).back().own_role(), proto::ROLE_BASE_STATION);
}

TEST_F(RoleActorTest, NotifiesAnActorThatStartsLateOrWhoseMailboxIsFull) {
  StartAndSettle();
  const auto leaders = std::make_shared<std::vector<AgentId>>();
  team_.Spawn(1, actor_name::kPgo, [leaders] { return std::make_unique<FakePgoActor>(leaders); });
  team_.RunUntilIdle();
  EXPECT_THAT(*leaders, testing::ElementsAre(1u)) << "at its start";
  disks_[1]->is_flooding = true;
  Swap(1);
  EXPECT_THAT(*leaders, testing::ElementsAre(1u, 2u));
}

TEST_F(RoleActorTest, ALeaderThatCannotStoreANewerTermStopsLeadingAtOnceAndReportsIt) {
  StartAndSettle();
  disks_[1]->is_failing = true;
  Swap(2);
  team_.AdvanceTime(seconds(1));
  const std::vector<proto::RolesChanged> all = Notified(1);
  ASSERT_FALSE(all.empty());
  const proto::RolesChanged& reported = all.back();
  EXPECT_EQ(reported.own_role(), proto::ROLE_ROVER);
  EXPECT_EQ(reported.roles().leader(), 2u);
  EXPECT_EQ(reported.roles().survivor(), 0u) << "taking a role waits until it is durable";
  const proto::RoleShowReply shown = Show(1);
  EXPECT_EQ(shown.roles().leader(), 2u);
  EXPECT_EQ(shown.unstored().term().number(), 2u);
  EXPECT_EQ(shown.unstored().survivor(), 1u);
  EXPECT_EQ(shown.confirmed_by_size(), 0);
  EXPECT_THAT(Show(2).confirmed_by(), testing::Not(testing::Contains(1)));

  // While its storage fails, agent 1 refuses a swap and refers the operator to another agent.
  Swap(1);
  EXPECT_THAT(Refusal(1).text, testing::HasSubstr("to another agent"));
  team_.AdvanceTime(minutes(5));
  EXPECT_TRUE(Notified(1).empty()) << "what it cannot store it does not publish again and again";

  disks_[1]->is_failing = false;
  team_.AdvanceTime(seconds(20));
  EXPECT_EQ(Notified(1).back().own_role(), proto::ROLE_DESIGNATED_SURVIVOR);
  EXPECT_FALSE(Show(1).has_unstored());
  EXPECT_TRUE(AllAgree());
  team_.AdvanceTime(minutes(2));
  EXPECT_THAT(Show(2).confirmed_by(), testing::ElementsAre(1, 2, 3, 4));
}

TEST_F(RoleActorTest, ALeaderWhoseStorageIsSilentStopsLeadingToo) {
  StartAndSettle();
  disks_[1]->is_silent = true;
  Swap(2);
  team_.AdvanceTime(seconds(6));
  EXPECT_EQ(Notified(1).back().own_role(), proto::ROLE_ROVER);
  disks_[1]->is_silent = false;
  team_.AdvanceTime(seconds(10));
  EXPECT_EQ(Notified(1).back().own_role(), proto::ROLE_DESIGNATED_SURVIVOR);
}

TEST_F(RoleActorTest, AnAgentThatCannotStoreItsRoleDoesNotLead) {
  StartAndSettle();
  disks_[3]->is_failing = true;
  proto::RoleSetRequest request;
  request.set_leader(3);
  Set(2, request);
  team_.AdvanceTime(seconds(30));
  EXPECT_EQ(Notified(1).back().own_role(), proto::ROLE_ROVER) << "agent 1 gave its role up";
  for (const proto::RolesChanged& reported : Notified(3)) EXPECT_NE(reported.roles().leader(), 3u);
  EXPECT_EQ(Show(3).roles().leader(), 0u);
  EXPECT_EQ(Show(3).unstored().leader(), 3u);
}

TEST_F(RoleActorTest, ADeposedLeaderOnAFullDiskAsksTheTeamAfterARestart) {
  StartAndSettle();
  disks_[1]->is_failing = true;
  Swap(2);
  team_.AdvanceTime(seconds(1));
  (void)Notified(1);
  team_.CrashActor({1, actor_name::kRole});
  team_.AdvanceTime(minutes(5));
  for (const proto::RolesChanged& reported : Notified(1)) {
    EXPECT_NE(reported.roles().leader(), 1u) << reported.ShortDebugString();
  }
  EXPECT_EQ(Show(1).roles().leader(), 2u);
}

TEST_F(RoleActorTest, NoAgentLeadsInANewTermThatCannotBeStored) {
  StartAndSettle();
  disks_[1]->is_failing = true;
  (void)Notified(1);
  team_.CrashActor({1, actor_name::kRole});
  team_.AdvanceTime(minutes(1));
  for (const proto::RolesChanged& reported : Notified(1)) EXPECT_NE(reported.roles().leader(), 1u);
  EXPECT_EQ(Show(1).unstored().leader(), 1u);
  EXPECT_EQ(Show(2).roles().term().number(), 1u) << "nobody hears of a term that is not durable";
  disks_[1]->is_failing = false;
  team_.AdvanceTime(seconds(10));
  EXPECT_EQ(Notified(1).back().own_role(), proto::ROLE_LEADER);
  EXPECT_TRUE(AllAgree());
}

TEST_F(RoleActorTest, LeaderActsOnlyInANewTerm) {
  Start();
  team_.RunUntilIdle();
  for (const auto& reported : Notified(1)) EXPECT_GT(reported.roles().term().number(), 0u);
}

TEST_F(RoleActorTest, SwapsRolesOnTheWholeTeam) {
  StartAndSettle();
  Swap(3);
  const proto::Message answer = Answer(3);
  EXPECT_EQ(answer.request_id(), 42u);
  EXPECT_EQ(answer.role_show_reply().roles().leader(), 2u);
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(AllAgree());
  EXPECT_EQ(Show(1).roles().leader(), 2u);
  EXPECT_EQ(Notified(1).back().own_role(), proto::ROLE_DESIGNATED_SURVIVOR);
}

TEST_F(RoleActorTest, ARepeatedSwapIsNotUndone) {
  StartAndSettle();
  proto::RoleSetRequest swap;
  swap.set_is_swap(true);
  *swap.mutable_expected() = Show(1).roles();
  Set(1, swap);
  team_.AdvanceTime(std::chrono::seconds(10));
  Set(1, swap);  // The operator got no answer in time and repeats the swap.
  EXPECT_EQ(Refusal(1).field, "expected");
  team_.AdvanceTime(std::chrono::seconds(10));
  EXPECT_TRUE(AllAgree());
  EXPECT_EQ(Show(3).roles().leader(), 2u);
}

// Tests a swap with wait_s: its answer is delayed until leader and survivor act on the new roles.
class RoleWaitTest : public RoleActorTest {
 protected:
  void SwapAndWait(AgentId at, double wait_s) {
    proto::RoleSetRequest request;
    request.set_is_swap(true);
    request.set_wait_s(wait_s);
    Set(at, request);
  }
};

TEST_F(RoleWaitTest, AnswersWhenLeaderAndSurvivorAct) {
  StartAndSettle();
  team_.radio().latency = milliseconds(100);
  SwapAndWait(1, 30);
  EXPECT_FALSE(Answer(1).has_role_show_reply()) << "agent 2 has not heard of it";
  ASSERT_TRUE(team_.RunUntil([&] { return Notified(2).size() > 0; }, seconds(10)));
  const auto answer = team_.Expect({1, actor_name::kGateway}, proto::Message::kRoleShowReply, seconds(10));
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->request_id(), 42u);
  const proto::RoleShowReply& shown = answer->role_show_reply();
  EXPECT_EQ(shown.roles().leader(), 2u);
  EXPECT_EQ(shown.roles().term().issuer(), 2u) << "the leader acts in a term of its own";
  EXPECT_TRUE(shown.not_confirmed_by().empty());
}

TEST_F(RoleWaitTest, NamesAgentsThatHaveNotConfirmedInTime) {
  StartAndSettle();
  team_.SetLink(1, 2, false);
  team_.SetLink(3, 2, false);
  team_.SetLink(4, 2, false);
  SwapAndWait(1, 30);
  team_.AdvanceTime(seconds(29));
  EXPECT_FALSE(Answer(1).has_role_show_reply());
  team_.AdvanceTime(seconds(2));
  const proto::RoleShowReply shown = Answer(1).role_show_reply();
  EXPECT_EQ(shown.roles().leader(), 2u);
  EXPECT_THAT(shown.not_confirmed_by(), testing::ElementsAre(2));
}

TEST_F(RoleWaitTest, IsRefusedIfAnotherChangeHappensFirst) {
  StartAndSettle();
  team_.SetLink(1, 2, false);
  team_.SetLink(3, 2, false);
  team_.SetLink(4, 2, false);
  SwapAndWait(1, 30);
  proto::RoleSetRequest other;
  other.set_leader(3);
  other.set_survivor(1);
  Set(1, other);
  std::vector<Error> errors;
  for (const proto::Message& message : team_.TakeMessages({1, actor_name::kGateway})) {
    const Result<void> answered = CheckControlReply(message);
    if (message.body_case() == proto::Message::kControlReply && !answered) errors.push_back(answered.error());
  }
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(errors[0].code, ErrorCode::kRefused);
  EXPECT_EQ(errors[0].text, "a later change replaced this one: leader agent3, survivor agent1");
}

TEST_F(RoleWaitTest, TooManyWaitingSwapsAreRefused) {
  StartAndSettle();
  for (const AgentId other : {1, 3, 4}) team_.SetLink(other, 2, false);
  for (int i = 0; i < 16; ++i) {
    proto::RoleSetRequest request;
    request.set_leader(2);
    request.set_survivor(3);
    request.set_reason("again " + std::to_string(i));
    request.set_wait_s(600);
    Set(1, request);
  }
  (void)team_.TakeMessages({1, actor_name::kGateway});
  SwapAndWait(1, 600);
  EXPECT_EQ(Refusal(1).code, ErrorCode::kFull);
}

TEST_F(RoleActorTest, AnswersWithTheErrorOfARefusedChange) {
  StartAndSettle();
  proto::RoleSetRequest request;
  request.set_leader(4);
  Set(1, request);
  EXPECT_EQ(Refusal(1).field, "leader");
  EXPECT_EQ(Show(1).roles().leader(), 1u);
}

TEST_F(RoleActorTest, DryRunShowsAndChangesNothing) {
  StartAndSettle();
  proto::RoleSetRequest request;
  request.set_is_swap(true);
  request.set_is_dry_run(true);
  Set(1, request);
  EXPECT_EQ(Answer(1).role_show_reply().roles().leader(), 2u);
  team_.AdvanceTime(seconds(10));
  EXPECT_EQ(Show(1).roles().leader(), 1u);
}

TEST_F(RoleActorTest, DoesNotActOnRolesThatCannotBeStored) {
  StartAndSettle();
  disks_[1]->is_failing = true;
  Swap(1);
  EXPECT_EQ(Refusal(1).code, ErrorCode::kFull);
  team_.AdvanceTime(seconds(10));
  EXPECT_EQ(Show(2).roles().leader(), 1u);
}

TEST_F(RoleActorTest, AsksASilentStorageAgain) {
  Start();
  team_.AdvanceTime(seconds(10));
  disks_[3]->is_silent = true;
  Swap(3);
  team_.AdvanceTime(seconds(12));
  EXPECT_EQ(Show(3).roles().leader(), 1u);
  disks_[3]->is_silent = false;
  team_.AdvanceTime(seconds(6));
  EXPECT_EQ(Show(3).roles().leader(), 2u);
  EXPECT_TRUE(AllAgree());
}

TEST_F(RoleActorTest, NotifiesAnAgentThatWasAway) {
  StartAndSettle();
  for (AgentId other : {1, 2, 4}) team_.SetLink(3, other, false);
  Swap(1);
  team_.AdvanceTime(minutes(5));
  EXPECT_FALSE(AllAgree());
  EXPECT_THAT(Show(1).confirmed_by(), testing::ElementsAre(1, 2, 4));
  for (AgentId other : {1, 2, 4}) team_.SetLink(3, other, true);
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(AllAgree());
}

TEST_F(RoleActorTest, ACrashedLeaderStepsDownWhenItReturns) {
  StartAndSettle();
  team_.Crash(1);
  proto::RoleSetRequest request;
  request.set_leader(2);
  request.set_survivor(3);
  Set(2, request);
  team_.AdvanceTime(minutes(1));
  Notified(1);
  team_.Restart(1);
  team_.AdvanceTime(seconds(5));
  EXPECT_TRUE(AllAgree());
  for (const auto& reported : Notified(1)) EXPECT_EQ(reported.roles().leader(), 2u) << "it never acted as leader again";
}

TEST_F(RoleActorTest, GivesUpItsRoleWhenAnActorFailsRepeatedly) {
  StartAndSettle();
  team_.Spawn(1, actor_name::kMerge, []() -> std::unique_ptr<Actor> { throw std::runtime_error("no GL"); });
  team_.AdvanceTime(seconds(10));
  EXPECT_TRUE(AllAgree());
  const auto roles = Show(1).roles();
  EXPECT_EQ(roles.leader(), 2u);
  EXPECT_EQ(roles.survivor(), 3u);
  EXPECT_EQ(roles.reason(), "actor merge fails: no GL");
}

TEST_F(RoleActorTest, GivesUpItsRoleOnceAnotherAgentCanTakeIt) {
  StartAndSettle();
  team_.Partition({{1}});
  proto::Message message;
  message.mutable_step_down()->set_actor(actor_name::kPgo);
  (void)team_.Post({1, "outside"}, {1, actor_name::kRole}, message);
  team_.AdvanceTime(minutes(1));
  EXPECT_EQ(Show(1).roles().leader(), 1u);
  team_.Heal();
  team_.AdvanceTime(seconds(10));
  EXPECT_TRUE(AllAgree());
  EXPECT_EQ(Show(1).roles().leader(), 2u);
}

TEST_F(RoleActorTest, LeaderTakesANewTermAtEachStart) {
  StartAndSettle();
  team_.Crash(1);
  team_.AdvanceTime(seconds(3));
  team_.Restart(1);
  team_.AdvanceTime(seconds(10));
  EXPECT_TRUE(AllAgree());
  EXPECT_EQ(Show(3).roles().term().number(), 2u);
  EXPECT_EQ(Show(1).history_size(), 2);
}

TEST_F(RoleActorTest, AcceptsOrdersOnlyFromItsOwnAgent) {
  StartAndSettle();
  proto::Message message;
  message.mutable_role_set_request()->set_is_swap(true);
  (void)team_.Post({2, actor_name::kRole}, {1, actor_name::kRole}, message);
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(Show(1).roles().leader(), 1u);
}

TEST_F(RoleActorTest, RefusesAndCountsTermsFarInTheFuture) {
  StartAndSettle();
  const proto::RoleAssignment before = Show(1).roles();
  proto::Message message;
  *message.mutable_role_announce()->mutable_roles() = before;
  message.mutable_role_announce()->mutable_roles()->mutable_term()->set_number(UINT64_MAX);
  for (int i = 0; i < 100; ++i) (void)team_.Post({2, actor_name::kRole}, {1, actor_name::kRole}, message);
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(Show(1).roles().SerializeAsString(), before.SerializeAsString());
  EXPECT_EQ(Show(1).refused_announcements(), 100);
}

TEST_F(RoleActorTest, IsSilentWhenAllHaveConfirmed) {
  StartAndSettle();
  team_.AdvanceTime(minutes(5));
  const std::uint64_t bytes = team_.radio_bytes();
  team_.AdvanceTime(minutes(60));
  EXPECT_EQ(team_.radio_bytes(), bytes);
}

// Sends random commands to random agents while actors fail, links break and the radio loses messages. Then the radio
// works, and all agents must agree on the newest term. No two assignments may ever have the same term.
class RoleActorChaosTest : public testing::TestWithParam<int> {};

TEST_P(RoleActorChaosTest, AllAgreeInTheEnd) {
  for (int i = 0; i < 10; ++i) {
    const auto seed = static_cast<std::uint64_t>(GetParam() * 10 + i);
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    RoleTeam team(seed);
    team.Start();
    team.team_.radio().loss_ratio = static_cast<double>(rng() % 40) / 100;
    team.team_.radio().duplicate_ratio = 0.2;
    team.team_.radio().latency_jitter = milliseconds(500);
    for (int step = 0; step < 20; ++step) {
      const auto agent = static_cast<AgentId>(1 + rng() % 4);
      const auto other = static_cast<AgentId>(1 + rng() % 4);
      switch (rng() % 5) {
        case 0:
          if (team.team_.is_running(agent)) team.Swap(agent);
          break;
        case 1:
          team.team_.is_running(agent) ? team.team_.Crash(agent) : team.team_.Restart(agent);
          break;
        case 2:
          if (agent != other) team.team_.SetLink(agent, other, rng() % 2 == 0, rng() % 2 == 0);
          break;
        case 3: {
          proto::RoleSetRequest request;
          request.set_leader(static_cast<AgentId>(1 + rng() % 3));
          request.set_survivor(1 + request.leader() % 3);
          if (team.team_.is_running(agent)) team.Set(agent, request);
          break;
        }
        default:
          break;
      }
      team.team_.AdvanceTime(milliseconds(rng() % 8000));
    }
    team.team_.radio() = simulation::RadioOptions();
    for (AgentId agent = 1; agent <= 4; ++agent) {
      if (!team.team_.is_running(agent)) team.team_.Restart(agent);
      for (AgentId other = 1; other < agent; ++other) team.team_.SetLink(agent, other, true);
    }
    team.team_.AdvanceTime(minutes(5));
    EXPECT_TRUE(team.AllAgree());
    std::map<std::tuple<std::uint64_t, AgentId, std::uint64_t>, std::string> by_term;
    for (const auto& [agent, disk] : team.disks_) {
      for (const proto::RoleAssignment& roles : disk->roles) {
        const std::string bytes = roles.SerializeAsString();
        const auto& known = by_term.emplace(OrderOf(roles.term()), bytes).first->second;
        EXPECT_EQ(known, bytes) << "two assignments in one term";
      }
    }
    ASSERT_FALSE(by_term.empty());
    EXPECT_EQ(OrderOf(team.Show(1).roles().term()), by_term.rbegin()->first) << "the newest term stands";
    const std::uint64_t bytes = team.team_.radio_bytes();
    team.team_.AdvanceTime(minutes(10));
    EXPECT_EQ(team.team_.radio_bytes(), bytes) << "no byte is sent permanently";
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, RoleActorChaosTest, testing::Range(0, 10));

}  // namespace
}  // namespace moondb
