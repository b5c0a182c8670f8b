#include "actors/role/role_logic.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/term.h"

namespace moondb {
namespace {

using testing::ElementsAre;

constexpr AgentId kSelf = 2;

proto::RoleAssignment Roles(AgentId leader, AgentId survivor, std::uint64_t number, AgentId issuer,
                            std::uint64_t epoch = 1) {
  proto::RoleAssignment roles;
  roles.set_leader(leader);
  roles.set_survivor(survivor);
  roles.mutable_term()->set_number(number);
  roles.mutable_term()->set_issuer(issuer);
  roles.mutable_term()->set_issuer_epoch(number == 0 ? 0 : epoch);
  return roles;
}

// Returns the options of agent `self` in a team of agents 1 to 3. Agent 1 is the leader. Agent 9 is not in the team.
RoleLogic::Options Options(AgentId self) {
  RoleLogic::Options options;
  options.self = self;
  options.agents = {1, 2, 3};
  options.initial = Roles(1, 2, 0, 0);
  options.check = [](const proto::RoleAssignment& roles) -> Result<void> {
    if (roles.leader() < 1 || roles.leader() > 3) return Fail(ErrorCode::kRefused, "no such agent", "leader");
    if (roles.survivor() > 3) return Fail(ErrorCode::kRefused, "no such agent", "survivor");
    if (roles.survivor() == roles.leader()) return Fail(ErrorCode::kRefused, "is the leader", "survivor");
    return {};
  };
  return options;
}

proto::RoleAnnounce Announce(const proto::RoleAssignment& roles, bool is_reply = false) {
  proto::RoleAnnounce announce;
  *announce.mutable_roles() = roles;
  announce.set_is_reply(is_reply);
  return announce;
}

std::vector<AgentId> Notified(const RoleLogic::Actions& actions) {
  std::vector<AgentId> agents;
  for (const auto& announcement : actions.announcements) agents.push_back(announcement.to);
  return agents;
}

class RoleLogicTest : public testing::Test {
 protected:
  RoleLogicTest() { logic_.OnLoaded({Roles(1, 2, 5, 1)}, 77, 0); }

  Result<proto::RoleAssignment> Propose(AgentId leader, AgentId survivor, bool is_swap = false) const {
    proto::RoleSetRequest request;
    request.set_leader(leader);
    request.set_survivor(survivor);
    request.set_is_swap(is_swap);
    return logic_.Propose(request, 0);
  }

  RoleLogic logic_{Options(kSelf)};
};

TEST_F(RoleLogicTest, StartsWithTheNewestStoredAssignmentAndAnnouncesIt) {
  RoleLogic logic(Options(kSelf));
  const auto actions = logic.OnLoaded({Roles(1, 2, 4, 1), Roles(3, 2, 5, 1)}, 77, 0);
  ASSERT_TRUE(actions.apply);
  EXPECT_EQ(actions.apply->leader(), 3u);
  EXPECT_THAT(Notified(actions), ElementsAre(1, 3));
  EXPECT_TRUE(actions.announce_timer);
}

TEST_F(RoleLogicTest, StartsWithTheTeamFileIfNothingIsStored) {
  RoleLogic logic(Options(kSelf));
  EXPECT_EQ(logic.OnLoaded({}, 77, 0).apply->leader(), 1u);
}

TEST_F(RoleLogicTest, FallsBackToTheTeamFileIfItForbidsTheStoredRoles) {
  RoleLogic logic(Options(kSelf));
  EXPECT_EQ(logic.OnLoaded({Roles(9, 2, 5, 1)}, 77, 0).apply->leader(), 1u);
  proto::RoleSetRequest request;
  request.set_leader(3);
  // Term number 5 counts as used, although its roles are invalid.
  EXPECT_EQ(logic.Propose(request, 0)->term().number(), 6u);
}

TEST_F(RoleLogicTest, IsSilentBeforeStorageAnswered) {
  RoleLogic logic(Options(kSelf));
  EXPECT_EQ(logic.Propose({}, 0).error().code, ErrorCode::kUnavailable);
  const auto actions = logic.OnAnnounce(1, Announce(Roles(3, 2, 9, 1)));
  ASSERT_TRUE(actions);
  EXPECT_FALSE(actions->save);
}

TEST_F(RoleLogicTest, KeepsTheRolesThatARequestDoesNotName) {
  const auto roles = Propose(3, 0);
  ASSERT_TRUE(roles);
  EXPECT_EQ(roles->leader(), 3u);
  EXPECT_EQ(roles->survivor(), 2u);
  EXPECT_EQ(OrderOf(roles->term()), OrderOf(Roles(3, 2, 6, kSelf, 77).term()));
}

TEST_F(RoleLogicTest, SwapsLeaderAndSurvivor) {
  const auto roles = Propose(0, 0, /*is_swap=*/true);
  ASSERT_TRUE(roles);
  EXPECT_EQ(roles->leader(), 2u);
  EXPECT_EQ(roles->survivor(), 1u);
}

TEST_F(RoleLogicTest, RefusesARequestThatExpectsOtherRoles) {
  proto::RoleSetRequest swap;
  swap.set_is_swap(true);
  *swap.mutable_expected() = Roles(1, 2, 5, 1);
  const auto roles = logic_.Propose(swap, 0);
  ASSERT_TRUE(roles);
  logic_.Adopt(*roles);
  logic_.OnSaved();
  ASSERT_EQ(logic_.current().leader(), 2u);
  const auto repeated = logic_.Propose(swap, 0);
  ASSERT_FALSE(repeated) << "it would undo itself";
  EXPECT_EQ(repeated.error().code, ErrorCode::kRefused);
  EXPECT_EQ(repeated.error().field, "expected");
  EXPECT_EQ(repeated.error().text,
            "agent 2 holds term 6 by agent 2: agent 2 leads, agent 1 is the designated survivor; the request expects "
            "term 5 by agent 1");
  swap.mutable_expected()->mutable_term()->set_number(6);
  swap.mutable_expected()->mutable_term()->set_issuer(kSelf);
  swap.mutable_expected()->mutable_term()->set_issuer_epoch(77);
  EXPECT_EQ(logic_.Propose(swap, 0).error().field, "expected") << "in this term others lead and survive";
  swap.mutable_expected()->set_leader(2);
  swap.mutable_expected()->set_survivor(1);
  EXPECT_TRUE(logic_.Propose(swap, 0));
}

TEST_F(RoleLogicTest, RefusesInvalidRoles) {
  // The present survivor would become the leader, but no new survivor is named.
  EXPECT_EQ(Propose(2, 0).error().field, "survivor");
  EXPECT_EQ(Propose(0, 1).error().code, ErrorCode::kRefused);
  EXPECT_EQ(Propose(9, 0).error().field, "leader");
  EXPECT_EQ(Propose(0, 0).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(Propose(3, 0, /*is_swap=*/true).error().code, ErrorCode::kInvalid);
  proto::RoleSetRequest wordy;
  wordy.set_leader(3);
  wordy.set_reason(std::string(257, 'x'));
  EXPECT_EQ(logic_.Propose(wordy, 0).error().field, "reason");
}

TEST_F(RoleLogicTest, ActsAndAnnouncesOnlyAfterTheAssignmentIsDurable) {
  const auto begun = logic_.Adopt(*Propose(3, 0));
  EXPECT_TRUE(begun.save);
  EXPECT_FALSE(begun.apply);
  EXPECT_TRUE(begun.announcements.empty());
  EXPECT_EQ(logic_.current().leader(), 1u);
  EXPECT_EQ(Propose(0, 3).error().code, ErrorCode::kUnavailable);  // Only one proposal at a time is accepted.
  const auto done = logic_.OnSaved();
  EXPECT_EQ(done.apply->leader(), 3u);
  EXPECT_THAT(Notified(done), ElementsAre(1, 3));
  EXPECT_EQ(logic_.current().leader(), 3u);
}

TEST_F(RoleLogicTest, KeepsItsRolesWhenStoringFails) {
  logic_.Adopt(*Propose(3, 0));
  logic_.OnSaveFailed();
  EXPECT_EQ(logic_.current().leader(), 1u);
  // Storing term number 6 failed, but the disk may contain it. The next proposal must have another number.
  EXPECT_EQ(Propose(3, 0)->term().number(), 7u);
}

TEST_F(RoleLogicTest, AdoptsANewerTermAndConfirmsIt) {
  const auto begun = logic_.OnAnnounce(3, Announce(Roles(3, 2, 6, 3)));
  ASSERT_TRUE(begun);
  EXPECT_EQ(begun->save->leader(), 3u);
  EXPECT_TRUE(begun->announcements.empty());
  const auto done = logic_.OnSaved();
  EXPECT_EQ(done.apply->leader(), 3u);
  EXPECT_THAT(Notified(done), ElementsAre(3, 1));
  EXPECT_TRUE(done.announcements[0].announce.is_reply());
}

TEST_F(RoleLogicTest, AnswersAnOlderTermWithItsNewerOne) {
  const auto actions = logic_.OnAnnounce(3, Announce(Roles(3, 2, 4, 3)));
  ASSERT_TRUE(actions);
  EXPECT_FALSE(actions->save);
  ASSERT_THAT(Notified(*actions), ElementsAre(3));
  EXPECT_EQ(actions->announcements[0].announce.roles().term().number(), 5u);
}

TEST_F(RoleLogicTest, OrdersTermsOfOneNumberByIssuerThenEpoch) {
  EXPECT_TRUE(logic_.OnAnnounce(3, Announce(Roles(3, 2, 5, 3)))->save);
  logic_.OnSaved();
  EXPECT_FALSE(logic_.OnAnnounce(1, Announce(Roles(1, 2, 5, 2)))->save);
  EXPECT_TRUE(logic_.OnAnnounce(1, Announce(Roles(1, 2, 5, 3, /*epoch=*/2)))->save);
}

TEST_F(RoleLogicTest, IssuesANewTermBeforeItLeadsInATermFromBeforeItsRestart) {
  logic_.OnAnnounce(3, Announce(Roles(kSelf, 1, 6, kSelf, /*epoch=*/76)));
  const auto heard = logic_.OnSaved();
  EXPECT_FALSE(heard.apply);
  ASSERT_TRUE(heard.save);
  EXPECT_EQ(OrderOf(heard.save->term()), OrderOf(Roles(kSelf, 1, 7, kSelf, 77).term()));
  EXPECT_EQ(logic_.OnSaved().apply->term().number(), 7u);
}

// Agent 3 announces a term in which this agent leads. This agent may have led in that term before it lost its disk, so
// it issues a new term.
TEST_F(RoleLogicTest, LeadsOnlyInTermsThatItIssuedItself) {
  proto::RoleAssignment named = Roles(kSelf, 1, 6, 3);
  named.set_reason("as the operator said");
  logic_.OnAnnounce(3, Announce(named));
  const auto heard = logic_.OnSaved();
  EXPECT_FALSE(heard.apply);
  ASSERT_TRUE(heard.save);
  EXPECT_EQ(OrderOf(heard.save->term()), OrderOf(Roles(kSelf, 1, 7, kSelf, 77).term()));
  EXPECT_EQ(heard.save->reason(), "as the operator said");
  EXPECT_EQ(logic_.OnSaved().apply->term().number(), 7u);
}

TEST_F(RoleLogicTest, RefusesInvalidAnnouncements) {
  const auto refused = [this](AgentId from, const proto::RoleAssignment& roles) {
    return !logic_.OnAnnounce(from, Announce(roles)).has_value();
  };
  EXPECT_TRUE(refused(9, Roles(3, 2, 6, 3)));
  EXPECT_TRUE(refused(3, Roles(3, 2, 6, 9)));
  EXPECT_TRUE(refused(3, Roles(3, 3, 6, 3)));
  EXPECT_TRUE(refused(3, Roles(9, 2, 6, 3)));
  EXPECT_TRUE(refused(3, Roles(3, 2, 5 + 1'000'001, 3)));
  EXPECT_TRUE(refused(3, Roles(3, 0, 6, 3))) << "a survivor never goes without another one";
  EXPECT_FALSE(refused(3, Roles(3, 2, 5 + 1'000'000, 3)));
  EXPECT_TRUE(refused(3, Roles(3, 2, 5, 1)));  // This assignment has the current term, but other roles.
}

TEST_F(RoleLogicTest, RepeatsTheAnnouncementUntilAllConfirm) {
  EXPECT_THAT(Notified(logic_.OnAnnounceTimer()), ElementsAre(1, 3));
  EXPECT_TRUE(logic_.OnAnnounce(1, Announce(Roles(1, 2, 5, 1), /*is_reply=*/true))->announcements.empty());
  const auto again = logic_.OnAnnounceTimer();
  EXPECT_THAT(Notified(again), ElementsAre(3));
  EXPECT_EQ(*again.announce_timer, std::chrono::seconds(20));  // This is the third delay, after 5 s and 10 s.
  EXPECT_THAT(Notified(*logic_.OnAnnounce(3, Announce(Roles(1, 2, 5, 1)))), ElementsAre(3));
  EXPECT_FALSE(logic_.OnAnnounceTimer().announce_timer);
  EXPECT_THAT(logic_.Show(false).confirmed_by(), ElementsAre(1, 2, 3));
}

TEST_F(RoleLogicTest, AnnouncesToAnUnconfirmedAgentAtOnceWhenItReconnects) {
  EXPECT_THAT(Notified(logic_.OnPeerConnected(3)), ElementsAre(3));
  logic_.OnAnnounce(3, Announce(Roles(1, 2, 5, 1), /*is_reply=*/true));
  EXPECT_TRUE(logic_.OnPeerConnected(3).announcements.empty());
  EXPECT_TRUE(logic_.OnPeerConnected(9).announcements.empty());
}

TEST_F(RoleLogicTest, ShowsItsHistory) {
  logic_.Adopt(*Propose(3, 0));
  logic_.OnSaved();
  EXPECT_EQ(logic_.Show(true).history_size(), 2);
  EXPECT_EQ(logic_.Show(false).history_size(), 0);
}

// Agent 1 starts with stored roles in which it is the leader.
class RoleLogicLeaderTest : public testing::Test {
 protected:
  RoleLogicLeaderTest() { started_ = logic_.OnLoaded({Roles(1, 2, 5, 1)}, 77, 0); }

  RoleLogic logic_{Options(1)};
  RoleLogic::Actions started_;
};

TEST_F(RoleLogicLeaderTest, AsksTheTeamBeforeItActs) {
  EXPECT_FALSE(started_.apply);
  EXPECT_TRUE(started_.leader_timer);
  EXPECT_THAT(Notified(started_), ElementsAre(2, 3));
}

TEST_F(RoleLogicLeaderTest, TakesANewTermWithTheSameRolesIfNoNewerOneIsKnown) {
  const auto begun = logic_.OnLeaderTimer(0);
  ASSERT_TRUE(begun.save);
  EXPECT_EQ(OrderOf(begun.save->term()), OrderOf(Roles(1, 2, 6, 1, 77).term()));
  EXPECT_EQ(begun.save->reason(), "restart of the leader");
  EXPECT_EQ(logic_.OnSaved().apply->leader(), 1u);
  EXPECT_FALSE(logic_.OnLeaderTimer(0).save);
}

TEST_F(RoleLogicLeaderTest, TakesANewTermAtOnceWhenAllAgree) {
  EXPECT_FALSE(logic_.OnAnnounce(2, Announce(Roles(1, 2, 5, 1), true))->save);
  EXPECT_TRUE(logic_.OnAnnounce(3, Announce(Roles(1, 2, 5, 1), true))->save);
}

TEST_F(RoleLogicLeaderTest, StepsDownWhenItHearsANewerTerm) {
  EXPECT_TRUE(logic_.OnAnnounce(2, Announce(Roles(2, 3, 6, 2), true))->save);
  EXPECT_EQ(logic_.OnSaved().apply->leader(), 2u);
  EXPECT_FALSE(logic_.OnLeaderTimer(0).save);
}

TEST_F(RoleLogicLeaderTest, TakesANewTermAboveThatOfItsLostDisk) {
  logic_.OnAnnounce(2, Announce(Roles(1, 3, 8, 2), true));
  const auto heard = logic_.OnSaved();
  EXPECT_FALSE(heard.apply);
  ASSERT_TRUE(heard.save);
  EXPECT_EQ(OrderOf(heard.save->term()), OrderOf(Roles(1, 3, 9, 1, 77).term()));
  EXPECT_TRUE(logic_.OnSaveFailed().leader_timer);
  EXPECT_TRUE(logic_.OnLeaderTimer(0).save);
  EXPECT_EQ(logic_.OnSaved().apply->survivor(), 3u);
}

TEST_F(RoleLogicLeaderTest, WaitsAgainWhenItsNewTermCannotBeStored) {
  logic_.OnLeaderTimer(0);
  EXPECT_TRUE(logic_.OnSaveFailed().leader_timer);
  EXPECT_TRUE(logic_.OnLeaderTimer(0).save);
}

TEST_F(RoleLogicLeaderTest, TakesTermOneIfNothingIsStored) {
  RoleLogic logic(Options(1));
  logic.OnLoaded({}, 77, 0);
  EXPECT_EQ(logic.OnLeaderTimer(0).save->term().number(), 1u);
}

TEST_F(RoleLogicTest, LeaderStepsDownInFavourOfTheSurvivor) {
  RoleLogic logic(Options(1));
  logic.OnLoaded({Roles(1, 2, 5, 1)}, 77, 0);
  const auto roles = logic.ProposeStepDown({2, 3}, "merge fails", 9);
  ASSERT_TRUE(roles);
  EXPECT_EQ(roles->leader(), 2u);
  EXPECT_EQ(roles->survivor(), 3u);
  EXPECT_EQ(roles->term().number(), 6u);
  EXPECT_EQ(roles->reason(), "merge fails");
}

TEST_F(RoleLogicTest, SteppingDownNamesOnlyConnectedAgents) {
  RoleLogic logic(Options(1));
  logic.OnLoaded({Roles(1, 2, 5, 1)}, 77, 0);
  EXPECT_EQ(logic.ProposeStepDown({}, "", 0).error().code, ErrorCode::kUnavailable);
  const auto to_third = logic.ProposeStepDown({3}, "", 0);  // The survivor is not connected.
  ASSERT_TRUE(to_third);
  EXPECT_EQ(to_third->leader(), 3u);
  EXPECT_EQ(to_third->survivor(), 1u);  // This agent becomes the survivor, because no other agent is connected.
}

TEST_F(RoleLogicTest, SurvivorStepsDownInFavourOfAThird) {
  const auto roles = logic_.ProposeStepDown({1, 3}, "", 0);
  ASSERT_TRUE(roles);
  EXPECT_EQ(roles->leader(), 1u);
  EXPECT_EQ(roles->survivor(), 3u);
  EXPECT_EQ(logic_.ProposeStepDown({1}, "", 0).error().code, ErrorCode::kUnavailable);
}

TEST_F(RoleLogicTest, AnAgentWithoutARoleGivesUpNone) {
  RoleLogic logic(Options(3));
  // The roles are not loaded yet.
  EXPECT_EQ(logic.ProposeStepDown({1, 2}, "", 0).error().code, ErrorCode::kUnavailable);
  logic.OnLoaded({Roles(1, 2, 5, 1)}, 77, 0);
  EXPECT_EQ(logic.ProposeStepDown({1, 2}, "", 0).error().code, ErrorCode::kNotFound);
}

// Agent 1 led the team and has left it.
TEST(RoleLogicLeftTest, NamesNoAgentThatHasLeftButKeepsItsAssignments) {
  RoleLogic::Options options = Options(kSelf);
  options.left = {1};
  RoleLogic logic(options);
  EXPECT_THAT(Notified(logic.OnLoaded({Roles(1, 2, 5, 1)}, 77, 0)), ElementsAre(3)) << "who left hears nothing";
  EXPECT_EQ(logic.current().leader(), 1u) << "history, until somebody decides";
  EXPECT_FALSE(logic.OnAnnounce(1, Announce(Roles(1, 2, 6, 1)))) << "who left says nothing";
  EXPECT_TRUE(logic.OnPeerConnected(1).announcements.empty());
  EXPECT_TRUE(logic.OnAnnounce(3, Announce(Roles(1, 3, 6, 1)))->save) << "what it issued is taken from others";
  logic.OnSaved();

  proto::RoleSetRequest request;
  request.set_survivor(2);
  const auto with_leader_that_left = logic.Propose(request, 0);
  ASSERT_FALSE(with_leader_that_left);
  EXPECT_EQ(ToString(with_leader_that_left.error()), "leader: agent 1 has left the team");
  request.set_leader(2);
  request.set_survivor(1);
  EXPECT_EQ(logic.Propose(request, 0).error().field, "survivor");
  request.set_survivor(3);
  const auto roles = logic.Propose(request, 0);
  ASSERT_TRUE(roles) << ToString(roles.error());
  logic.Adopt(*roles);
  logic.OnSaved();
  EXPECT_TRUE(logic.OnAnnounceTimer().announce_timer);
  logic.OnAnnounce(3, Announce(logic.current(), /*is_reply=*/true));
  EXPECT_FALSE(logic.OnAnnounceTimer().announce_timer) << "nobody waits for who left";
}

TEST(RoleLogicLeftTest, DoesNotStepDownInFavourOfAnAgentThatHasLeft) {
  RoleLogic::Options options = Options(1);
  options.left = {2};
  RoleLogic logic(options);
  logic.OnLoaded({Roles(1, 2, 5, 1)}, 77, 0);
  const auto roles = logic.ProposeStepDown({2, 3}, "", 0);
  ASSERT_TRUE(roles) << ToString(roles.error());
  EXPECT_EQ(roles->leader(), 3u);
  EXPECT_EQ(roles->survivor(), 1u);
}

}  // namespace
}  // namespace moondb
