// Tests orders to share: in which terms agents accept them, which sessions complete them, and which records a new
// leader gathers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "actors/lease/lease_actor.h"
#include "model/order_number.h"
#include "model/term.h"
#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/memory_store.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::UnorderedElementsAre;

constexpr AgentId kLeader = 1;

// A team with records in memory: agent 1 (leader), 2 (survivor), 3 (rover) and 4 (base station).
class SharingOrdersTest : public testing::Test {
 protected:
  SharingOrdersTest() {
    for (AgentId agent = 1; agent <= 4; ++agent) stores_[agent] = AddMemoryAgent(team_, agent, config_);
  }

  static proto::Message OrderInTerm(proto::SharingKind kind, const proto::Term& term) {
    proto::Message order = ShareOrder(kind);
    *order.mutable_share_request()->mutable_expected_term() = term;
    return order;
  }

  void InsertAt(AgentId agent, int count) {
    for (int i = 0; i < count; ++i) stores_[agent]->Insert(agent, proto::POSE_GRAPH_NODE, "node " + std::to_string(i));
  }

  // Returns the progress of the leader's orders in the session from `agent` to the leader. Empty if there is no such
  // session.
  proto::SessionOrder LeadersOrderAt(AgentId agent) {
    const proto::ShareStatus status = ShareStatusOf(team_, agent, actor_name::kSync);
    for (const proto::ShareSession& session : status.sessions()) {
      for (const proto::SessionOrder& order : session.orders()) {
        if (session.destination() == kLeader && order.agent() == kLeader) return order;
      }
    }
    return {};
  }

  const proto::TeamConfig config_ = TestTeam(3);
  std::map<AgentId, std::shared_ptr<MemoryStore>> stores_;
  simulation::SimulatedTeam team_{1};
};

TEST_F(SharingOrdersTest, AnOrderOfAnotherTermIsRefusedWithTheCurrentRoles) {
  NotifyRoles(team_, config_, kLeader, Roles(kLeader, 2, 3));
  for (const auto kind : {proto::SHARING_KIND_SYNC, proto::SHARING_KIND_REPLICATION}) {
    for (const std::uint64_t other : {2, 4}) {
      const auto refused = Share(team_, kLeader, OrderInTerm(kind, Roles(kLeader, 2, other).term()));
      EXPECT_EQ(refused.error().code(), proto::ERROR_CODE_REFUSED);
      EXPECT_EQ(refused.error().field(), "expected_term");
      EXPECT_EQ(refused.error().text(),
                "the roles have changed: rover1 acts on term 3 by rover1, but the order requires term " +
                    std::to_string(other) + " by rover1");
      EXPECT_EQ(refused.roles().term().number(), 3u);
    }
    const auto taken = Share(team_, kLeader, OrderInTerm(kind, Roles(kLeader, 2, 3).term()));
    EXPECT_FALSE(IsError(taken.error())) << taken.error().text();
    EXPECT_EQ(taken.roles().leader(), kLeader);
    EXPECT_NE(taken.order(), 0u);
    EXPECT_FALSE(IsError(Share(team_, kLeader, ShareOrder(kind)).error())) << "names no term";
    proto::Message elsewhere = OrderInTerm(kind, Roles(kLeader, 2, 2).term());
    elsewhere.mutable_share_request()->set_destination(3);
    EXPECT_FALSE(IsError(Share(team_, kLeader, elsewhere).error()))
        << "goes to the named agent, regardless of the leader";
  }
}

TEST_F(SharingOrdersTest, AgentsAcceptOrdersFromEachOtherInAnyTerm) {
  proto::Message order = OrderInTerm(proto::SHARING_KIND_SYNC, Roles(kLeader, 2, 9).term());
  order.mutable_share_request()->set_destination(kLeader);
  InsertAt(3, 5);
  ASSERT_EQ(team_.Post({kLeader, actor_name::kSync}, {3, actor_name::kSync}, order), SendResult::kAccepted);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[kLeader]->records().size(), 5u);
}

// A sharing actor requests the roles when it starts. A notification of newer roles may arrive before the reply.
TEST_F(SharingOrdersTest, AnOldAnswerDoesNotOvertakeNewRoles) {
  NotifyRoles(team_, config_, 3, Roles(3, 2, 5));
  for (const char* actor : {actor_name::kSync, actor_name::kReplica}) {
    proto::Message late;
    *late.mutable_role_show_reply()->mutable_roles() = Roles(kLeader, 2, 4);
    (void)team_.Post({3, actor_name::kRole}, {3, actor}, late);
    EXPECT_EQ(ShareStatusOf(team_, 3, actor).roles().leader(), 3u) << actor;
  }
  InsertAt(2, 5);
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(stores_[3]->records().size(), 5u) << "it still leads, and gathers";
}

TEST_F(SharingOrdersTest, StatusShowsFromWhichAgentsANewLeaderStillGathers) {
  team_.SetLink(3, 2, false);
  team_.radio().bytes_per_second = 2'000;
  InsertAt(kLeader, 30);
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  proto::ShareStatus status = ShareStatusOf(team_, 3, actor_name::kReplica);
  EXPECT_EQ(status.roles().term().number(), 3u);
  EXPECT_THAT(status.gathers_from(), UnorderedElementsAre(1, 2, 4));
  EXPECT_EQ(status.gathers_now_from(), kLeader);
  ASSERT_EQ(status.gathers_later_size(), 1);
  EXPECT_EQ(status.gathers_later(0).agent(), 2u);
  EXPECT_TRUE(status.gathers_later(0).is_away());
  EXPECT_EQ(status.gathers_later(0).why(), "is out of reach");
  EXPECT_TRUE(ShareStatusOf(team_, 2, actor_name::kReplica).gathers_from().empty()) << "only a leader gathers";

  team_.AdvanceTime(seconds(60));
  status = ShareStatusOf(team_, 3, actor_name::kReplica);
  EXPECT_THAT(status.gathers_from(), ElementsAre(2));
  EXPECT_EQ(status.gathers_now_from(), 0u);
  EXPECT_EQ(stores_[3]->records().size(), 30u);
  team_.SetLink(3, 2, true);
  team_.AdvanceTime(seconds(10));
  EXPECT_TRUE(ShareStatusOf(team_, 3, actor_name::kReplica).gathers_from().empty());
}

TEST_F(SharingOrdersTest, StatusShowsForHowLongAnAgentCannotBeAsked) {
  for (AgentId agent = 1; agent <= 4; ++agent) {
    LeaseActor::Options options;
    options.self = agent;
    options.team = config_;
    team_.Spawn(agent, actor_name::kLease, [options] { return std::make_unique<LeaseActor>(options); });
  }
  team_.AdvanceTime(seconds(1));
  proto::Message lease;
  lease.mutable_lease_request()->set_kind(proto::LEASE_KIND_SLEEPING);
  lease.mutable_lease_request()->set_seconds(600);
  (void)team_.Post({2, actor_name::kGateway}, {2, actor_name::kLease}, lease);
  team_.AdvanceTime(seconds(1));
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  Share(team_, 3, ShareOrder(proto::SHARING_KIND_REPLICATION));
  team_.AdvanceTime(seconds(9));
  const proto::ShareStatus status = ShareStatusOf(team_, 3, actor_name::kReplica);
  ASSERT_EQ(status.gathers_later_size(), 1);
  EXPECT_FALSE(status.gathers_later(0).is_away());
  EXPECT_THAT(status.gathers_later(0).why(), testing::StartsWith("rover2 sleeps for 59"));
  ASSERT_EQ(status.sessions_size(), 1);
  EXPECT_NEAR(status.sessions(0).waits_for_s(), 590, 1);
}

TEST_F(SharingOrdersTest, ASessionOfAnEarlierOrderDoesNotCompleteALaterOne) {
  InsertAt(2, 100);
  team_.radio().bytes_per_second = 3'000;
  const std::uint64_t earlier = Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC)).order();
  ASSERT_NE(earlier, 0u);
  team_.AdvanceTime(std::chrono::milliseconds(200));
  ASSERT_TRUE(HasReached(LeadersOrderAt(2).ordered(), earlier));
  ASSERT_FALSE(HasReached(LeadersOrderAt(2).completed(), earlier));

  // Agent 2 does not receive the later order while its session for the earlier order continues.
  team_.SetFilter(
      [](AgentId, AgentId to, const proto::Message& message) { return to != 2 || !message.has_share_request(); });
  const std::uint64_t later = Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC)).order();
  EXPECT_TRUE(HasReached(later, earlier));
  EXPECT_FALSE(HasReached(earlier, later));
  ASSERT_TRUE(team_.RunUntil([&] { return HasReached(LeadersOrderAt(2).completed(), earlier); }, seconds(60)));
  EXPECT_FALSE(HasReached(LeadersOrderAt(2).completed(), later));
  stores_[2]->Insert(2, proto::POSE_GRAPH_NODE, "after the session, before the order came");
  team_.SetFilter({});
  ASSERT_TRUE(team_.RunUntil([&] { return HasReached(LeadersOrderAt(2).completed(), later); }, seconds(60)));
  EXPECT_EQ(stores_[kLeader]->records().size(), 101u);
}

TEST_F(SharingOrdersTest, TheAnswerToAnEarlierOrderDoesNotCountForALaterOne) {
  const std::uint64_t earlier = Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC)).order();
  team_.AdvanceTime(seconds(5));
  team_.SetFilter(
      [](AgentId, AgentId to, const proto::Message& message) { return to != 2 || !message.has_share_request(); });
  const std::uint64_t later = Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC)).order();
  proto::Message late;
  late.set_request_id(earlier);
  late.mutable_share_reply()->set_session_count(1);
  (void)team_.Post({2, actor_name::kSync}, {kLeader, actor_name::kSync}, late);
  team_.AdvanceTime(seconds(1));
  team_.SetFilter({});
  team_.AdvanceTime(seconds(60));
  EXPECT_TRUE(HasReached(LeadersOrderAt(2).completed(), later)) << "it is given again until it is answered";
}

TEST_F(SharingOrdersTest, ALateCopyOfAnOrderChangesNothing) {
  const std::uint64_t earlier = Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC)).order();
  const std::uint64_t later = Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC)).order();
  team_.AdvanceTime(seconds(5));
  proto::Message copy = ShareOrder(proto::SHARING_KIND_SYNC, kLeader);
  copy.mutable_share_request()->set_order(earlier);
  (void)team_.Post({kLeader, actor_name::kSync}, {2, actor_name::kSync}, copy);
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(LeadersOrderAt(2).ordered(), later);
  EXPECT_EQ(LeadersOrderAt(2).completed(), later);
}

// Agent 3 begins to lead and gathers first from agent 2, the survivor. Agent 2 sends only batches that the leader
// refuses. The leader must then gather from agent 1, which holds 10 records.
TEST_F(SharingOrdersTest, ARefusedBatchIsNoProgress) {
  InsertAt(kLeader, 10);
  // Agent 2 does not receive the leader's request.
  team_.SetFilter(
      [](AgentId, AgentId to, const proto::Message& message) { return to != 2 || !message.has_share_request(); });
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  for (int i = 0; i < 7; ++i) {
    proto::Message batch;
    batch.set_remaining(1);
    batch.mutable_batch()->set_session_id(77);
    batch.mutable_batch()->set_batch_number(1);
    (void)team_.Post({2, actor_name::kReplica}, {3, actor_name::kReplica}, batch);
    team_.AdvanceTime(seconds(10));
  }
  EXPECT_EQ(stores_[3]->records().size(), 10u);
}

}  // namespace
}  // namespace moondb
