#include "actors/sharing/replica_actor.h"

#include <gtest/gtest.h>

#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/memory_store.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::seconds;

class ReplicaActorTest : public testing::Test {
 protected:
  ReplicaActorTest() {
    for (AgentId agent = 1; agent <= 4; ++agent) {
      stores_[agent] = AddMemoryAgent(team_, agent, config_);
    }
  }

  void InsertAtLeader(int count_each) {
    for (AgentId origin = 1; origin <= 3; ++origin) {
      for (int i = 0; i < count_each; ++i) {
        stores_[1]->Insert(origin, proto::POSE_GRAPH_NODE, "node " + std::to_string(i));
      }
    }
  }

  const proto::TeamConfig config_ = TestTeam(3);
  std::map<AgentId, std::shared_ptr<MemoryStore>> stores_;
  simulation::SimulatedTeam team_{1};
};

TEST_F(ReplicaActorTest, SendsAllRecordsOfTheLeaderToTheSurvivor) {
  InsertAtLeader(100);
  EXPECT_EQ(Share(team_, 1, ShareOrder(proto::SHARING_KIND_REPLICATION)).session_count(), 1u);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[2]->records(), stores_[1]->records());
  const auto status = ShareStatusOf(team_, 1, actor_name::kReplica);
  ASSERT_EQ(status.sessions_size(), 1);
  EXPECT_EQ(status.sessions(0).destination(), 2u);
  EXPECT_EQ(status.sessions(0).acknowledged_records(), 300);
  EXPECT_EQ(ShareStatusOf(team_, 2, actor_name::kReplica).received_records(), 300);
}

TEST_F(ReplicaActorTest, DoesNotReturnRecordsThatTheirOriginStillHas) {
  InsertAtLeader(10);
  for (int i = 0; i < 10; ++i) stores_[2]->Insert(2, proto::POSE_GRAPH_NODE, "node " + std::to_string(i));
  Share(team_, 1, ShareOrder(proto::SHARING_KIND_REPLICATION));
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(ShareStatusOf(team_, 1, actor_name::kReplica).sessions(0).sent_records(), 20);
  EXPECT_EQ(stores_[2]->records(), stores_[1]->records());
}

TEST_F(ReplicaActorTest, NamesTheLeaderWhenAnotherAgentGetsTheOrder) {
  const auto reply = Share(team_, 3, ShareOrder(proto::SHARING_KIND_REPLICATION));
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_EQ(reply.error().text(), "rover3 does not lead: send the command to the leader, rover1");
  EXPECT_EQ(Share(team_, 3, ShareOrder(proto::SHARING_KIND_REPLICATION, 2)).session_count(), 1u);
}

// After its restart the leader of the team file may have been replaced, or have to gather records first.
TEST_F(ReplicaActorTest, RefusesOrdersUntilItKnowsWhetherItLeads) {
  team_.Crash(1);
  team_.Restart(1);
  for (const proto::SharingKind kind : {proto::SHARING_KIND_REPLICATION, proto::SHARING_KIND_SYNC}) {
    const auto reply = Share(team_, 1, ShareOrder(kind));
    EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_UNAVAILABLE);
    EXPECT_EQ(reply.error().text(),
              "rover1 does not know yet whether it still leads: it is asking the other agents; try again");
  }
  NotifyRoles(team_, config_, 1, Roles(3, 1, 3));
  EXPECT_EQ(Share(team_, 1, ShareOrder(proto::SHARING_KIND_REPLICATION)).error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_EQ(Share(team_, 1, ShareOrder(proto::SHARING_KIND_SYNC)).session_count(), 1u);
}

TEST_F(ReplicaActorTest, RefusesWithoutASurvivor) {
  NotifyRoles(team_, config_, 1, Roles(1, 0, 3));
  const auto reply = Share(team_, 1, ShareOrder(proto::SHARING_KIND_REPLICATION));
  EXPECT_EQ(reply.error().text(), "no designated survivor is assigned");
}

TEST_F(ReplicaActorTest, RedirectsAnUnfinishedReplicationToTheNewSurvivor) {
  InsertAtLeader(10);
  team_.SetLink(1, 2, false);
  Share(team_, 1, ShareOrder(proto::SHARING_KIND_REPLICATION));
  NotifyRoles(team_, config_, 1, Roles(1, 3, 3));
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[3]->records(), stores_[1]->records());
  EXPECT_TRUE(stores_[2]->records().empty());
}

TEST_F(ReplicaActorTest, ANewLeaderGathersAllRecordsOfTheTeamOnce) {
  InsertAtLeader(10);
  stores_[4]->Insert(4, proto::POSE_GRAPH_NODE, "of the base station");
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[3]->records().size(), 31u);
  InsertAtLeader(1);
  team_.AdvanceTime(seconds(100));
  EXPECT_EQ(stores_[3]->records().size(), 31u);
  // Agent 3 begins another term. It may have restarted with an empty disk, so it gathers again.
  NotifyRoles(team_, config_, 3, Roles(3, 2, 4));
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[3]->records().size(), 34u);
}

TEST(ReplicaActorLeftTest, ANewLeaderGathersFromNoAgentThatHasLeft) {
  proto::TeamConfig config = TestTeam(3);
  config.mutable_agents(0)->set_left(true);
  simulation::SimulatedTeam team(1);
  for (const AgentId agent : {1u, 2u, 3u, 4u}) AddMemoryAgent(team, agent, config);
  team.SetLink(1, 3, false);
  NotifyRoles(team, config, 3, Roles(3, 2, 3));
  team.AdvanceTime(seconds(2));
  const proto::ShareStatus status = ShareStatusOf(team, 3, actor_name::kReplica);
  EXPECT_TRUE(status.gathers_from().empty()) << status.ShortDebugString();
  NotifyRoles(team, config, 3, Roles(3, 1, 4));
  EXPECT_EQ(Share(team, 3, ShareOrder(proto::SHARING_KIND_REPLICATION)).error().text(),
            "rover1 is the designated survivor, but has left the team; assign another one");
}

// Agents 2 (the survivor) and 3 both hold all 30 records of the leader.
TEST_F(ReplicaActorTest, GathersFromTheSurvivorFirstAndNoRecordTwice) {
  InsertAtLeader(10);
  for (const AgentId agent : {2u, 3u}) Share(team_, 1, ShareOrder(proto::SHARING_KIND_REPLICATION, agent));
  team_.AdvanceTime(seconds(2));
  *stores_[1] = MemoryStore();  // The leader loses its disk.
  NotifyRoles(team_, config_, 1, Roles(1, 2, 3));
  team_.AdvanceTime(seconds(10));
  EXPECT_EQ(stores_[1]->records().size(), 30u);
  EXPECT_EQ(ShareStatusOf(team_, 2, actor_name::kReplica).sessions(0).sent_records(), 30);
  EXPECT_EQ(ShareStatusOf(team_, 3, actor_name::kReplica).sessions(0).sent_records(), 0);
}

TEST_F(ReplicaActorTest, KeepsGatheringWhileOneAgentDoesNotAnswer) {
  InsertAtLeader(10);
  stores_[4]->Insert(4, proto::POSE_GRAPH_NODE, "of the base station");
  // Cuts the link to the survivor, agent 2. The new leader, agent 3, asks the survivor first.
  team_.SetLink(3, 2, false, /*tell=*/false);
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  team_.AdvanceTime(seconds(50));
  EXPECT_TRUE(stores_[3]->records().empty());
  team_.AdvanceTime(seconds(20));
  EXPECT_EQ(stores_[3]->records().size(), 31u);
  stores_[2]->Insert(2, proto::POWER, "of the survivor");
  team_.SetLink(3, 2, true);
  // Allows 30 s, because neither agent had noticed that the link was cut.
  team_.AdvanceTime(seconds(30));
  EXPECT_EQ(stores_[3]->records().size(), 32u);
}

// The new leader, agent 3, cannot reach agents 2 and 4. Agent 3 gathers from agent 1 immediately, and from agent 2 when
// agent 2 connects again.
TEST_F(ReplicaActorTest, GathersFromReachableAgents) {
  InsertAtLeader(10);
  stores_[2]->Insert(2, proto::POWER, "of the survivor");
  team_.SetLink(3, 2, false);
  team_.SetLink(3, 4, false);
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[3]->records().size(), 30u);
  const std::uint64_t bytes = team_.radio_bytes();
  team_.AdvanceTime(std::chrono::hours(2));
  EXPECT_EQ(team_.radio_bytes(), bytes) << "nothing is sent to nobody";
  team_.SetLink(3, 2, true);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[3]->records().size(), 31u);
}

TEST_F(ReplicaActorTest, AFlappingAgentDoesNotKeepOthersWaiting) {
  InsertAtLeader(10);
  team_.radio().bytes_per_second = 2'000;
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  for (int i = 0; i < 30; ++i) {
    team_.SetLink(3, 2, i % 2 != 0);
    team_.AdvanceTime(std::chrono::milliseconds(500));
  }
  EXPECT_EQ(stores_[3]->records().size(), 30u);
}

// The other agents receive the new leader's order before they learn of the new term.
TEST_F(ReplicaActorTest, SendsTheNewLeaderEverythingThoughItLearnsItsTermLater) {
  InsertAtLeader(10);
  team_.radio().bytes_per_second = 2'000;
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  team_.AdvanceTime(std::chrono::milliseconds(300));
  ASSERT_LT(stores_[3]->records().size(), 30u);
  for (const AgentId agent : {1u, 2u, 4u}) NotifyRoles(team_, config_, agent, Roles(3, 2, 3));
  team_.AdvanceTime(seconds(30));
  EXPECT_EQ(stores_[3]->records().size(), 30u);
  for (const AgentId agent : {1u, 2u, 4u}) {
    const proto::ShareStatus status = ShareStatusOf(team_, agent, actor_name::kReplica);
    ASSERT_EQ(status.sessions_size(), 1);
    EXPECT_EQ(status.sessions(0).closed_sessions(), 0u);
  }
}

TEST_F(ReplicaActorTest, ADeposedLeaderStopsGathering) {
  InsertAtLeader(10);
  team_.SetLink(1, 3, false);
  team_.SetLink(2, 3, false);
  NotifyRoles(team_, config_, 3, Roles(3, 2, 3));
  team_.AdvanceTime(seconds(5));
  NotifyRoles(team_, config_, 3, Roles(2, 1, 4));
  team_.SetLink(1, 3, true);
  team_.AdvanceTime(seconds(100));
  EXPECT_TRUE(stores_[3]->records().empty());
}

}  // namespace
}  // namespace moondb
