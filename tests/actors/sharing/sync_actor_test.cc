#include "actors/sharing/sync_actor.h"

#include <gtest/gtest.h>

#include <map>
#include <random>

#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/memory_store.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

constexpr AgentId kLeader = 1;
constexpr AgentId kBase = 4;

// A team with records in memory: agents 1 (leader), 2 and 3 are rovers, and 4 is the base station.
class MemoryTeam {
 public:
  explicit MemoryTeam(std::uint64_t seed) : team_(seed) {
    for (AgentId agent = 1; agent <= 4; ++agent) {
      stores_[agent] = AddMemoryAgent(team_, agent, config_);
    }
  }

  void InsertAll(int count_each) {
    for (AgentId agent = 1; agent <= 4; ++agent) {
      for (int i = 0; i < count_each; ++i) {
        stores_[agent]->Insert(agent, proto::POSE_GRAPH_NODE, "node " + std::to_string(i));
      }
    }
  }

  bool LeaderHasAll(int count_each) {
    return stores_[kLeader]->records().size() == static_cast<std::size_t>(4 * count_each);
  }

  double SentRecords() {
    double sent = 0;
    for (AgentId agent = 1; agent <= 4; ++agent) {
      const proto::ShareStatus status = ShareStatusOf(team_, agent, actor_name::kSync);
      for (const auto& session : status.sessions()) sent += session.sent_records();
    }
    return sent;
  }

  const proto::TeamConfig config_ = TestTeam(3);
  std::map<AgentId, std::shared_ptr<MemoryStore>> stores_;
  simulation::SimulatedTeam team_;
};

class SyncActorTest : public testing::Test, protected MemoryTeam {
 protected:
  SyncActorTest() : MemoryTeam(/*seed=*/1) {}
};

TEST_F(SyncActorTest, SendsARoversOwnRecordsToTheLeader) {
  stores_[2]->Insert(2, proto::POSE_GRAPH_NODE, "own");
  stores_[2]->Insert(3, proto::POSE_GRAPH_NODE, "of another");
  const auto reply = Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  EXPECT_EQ(reply.session_count(), 1u);
  team_.AdvanceTime(seconds(1));
  ASSERT_EQ(stores_[kLeader]->records().size(), 1u);
  EXPECT_EQ(stores_[kLeader]->records().begin()->second, "own");
}

TEST(SyncActorLargeTeamTest, CollectsFromAllAtOnce) {
  // With the base station, this is the largest team that a team file may define.
  constexpr int kRoverCount = 63;
  const proto::TeamConfig config = TestTeam(kRoverCount);
  simulation::SimulatedTeam team(1);
  const auto leaders = std::make_shared<MemoryStore>();
  for (AgentId agent = 1; agent <= kRoverCount + 1; ++agent) {
    team.AddAgent(agent);
    const auto store = agent == kLeader ? leaders : std::make_shared<MemoryStore>();
    if (agent != kLeader) store->Insert(agent, proto::POSE_GRAPH_NODE, "node");
    team.Spawn(agent, actor_name::kStorage, [store] { return std::make_unique<MemoryStorageActor>(store); });
    SpawnSharing(team, agent, config);
  }
  Share(team, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team.AdvanceTime(seconds(4));
  EXPECT_EQ(leaders->records().size(), std::size_t{kRoverCount});
}

TEST_F(SyncActorTest, CollectsFromTheWholeTeamAtTheLeadersOrder) {
  InsertAll(50);
  const auto reply = Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  EXPECT_EQ(reply.session_count(), 6u);  // The leader requests three sessions and opens three itself.
  team_.AdvanceTime(seconds(2));
  EXPECT_TRUE(LeaderHasAll(50));
}

TEST(SyncActorLeftTest, DoesNotAskAnAgentThatHasLeftButForwardsItsRecords) {
  proto::TeamConfig config = TestTeam(3);
  config.mutable_agents(2)->set_left(true);
  simulation::SimulatedTeam team(1);
  std::map<AgentId, std::shared_ptr<MemoryStore>> stores;
  for (const AgentId agent : {1u, 2u, 3u, 4u}) stores[agent] = AddMemoryAgent(team, agent, config);
  stores[3]->Insert(3, proto::POSE_GRAPH_NODE, "what it keeps for itself");
  stores[kLeader]->Insert(3, proto::POSE_GRAPH_NODE, "what it brought before");
  EXPECT_EQ(Share(team, kLeader, ShareOrder(proto::SHARING_KIND_SYNC)).session_count(), 4u) << "rover2 and base";
  team.AdvanceTime(seconds(2));
  EXPECT_EQ(stores[kLeader]->records().size(), 1u);
  EXPECT_EQ(stores[3]->records().size(), 1u);
  EXPECT_EQ(stores[4]->records().size(), 1u) << "the ground station has its record";
  const auto refused = Share(team, kLeader, ShareOrder(proto::SHARING_KIND_SYNC, 3));
  EXPECT_EQ(refused.error().text(), "rover3 has left the team");
  proto::Message order = ShareOrder(proto::SHARING_KIND_SYNC);
  order.mutable_share_request()->add_from_agents(3);
  EXPECT_EQ(Share(team, kLeader, order).error().field(), "from_agents[0]");
  NotifyRoles(team, config, 2, Roles(3, 2, 3));
  EXPECT_EQ(Share(team, 2, ShareOrder(proto::SHARING_KIND_SYNC)).error().text(),
            "rover3 is the leader, but has left the team; assign another one");
}

TEST_F(SyncActorTest, CollectsFromNamedAgentsOnly) {
  InsertAll(5);
  proto::Message order = ShareOrder(proto::SHARING_KIND_SYNC);
  order.mutable_share_request()->add_from_agents(3);
  EXPECT_EQ(Share(team_, kLeader, order).session_count(), 1u);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[kLeader]->records().size(), 10u);
  EXPECT_EQ(stores_[2]->records().size(), 5u);
}

TEST_F(SyncActorTest, SendsRoversTheirPosesAndTheBaseStationTheTypesOfItsPolicy) {
  stores_[kLeader]->Insert(1, proto::OPTIMIZED_POSE, "pose");
  stores_[kLeader]->Insert(1, proto::POSE_GRAPH_NODE, "node");
  stores_[kLeader]->Insert(3, proto::LOCAL_TRAVERSABILITY_MAP, "map");
  stores_[kLeader]->Insert(3, proto::POWER, "power");
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(2));
  ASSERT_EQ(stores_[2]->records().size(), 1u);
  EXPECT_EQ(stores_[2]->records().begin()->second, "pose");
  std::vector<std::string> ground;
  for (const auto& [key, content] : stores_[kBase]->records()) ground.push_back(content);
  EXPECT_EQ(ground, (std::vector<std::string>{"node", "map"}));
}

TEST_F(SyncActorTest, SendsMapMatchesToTheLeaderAndNotToRovers) {
  stores_[kLeader]->Insert(1, proto::MAP_MATCH, "of the leader");
  stores_[2]->Insert(2, proto::MAP_MATCH, "of a former leader");
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(stores_[kLeader]->records().size(), 2u);
  EXPECT_EQ(stores_[2]->records().size(), 1u);
  EXPECT_TRUE(stores_[3]->records().empty());
}

TEST_F(SyncActorTest, SendsNothingTwice) {
  InsertAll(20);
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(2));
  const double sent = SentRecords();
  // 60 records go to the leader. The base station receives the 60 records that it lacks.
  EXPECT_EQ(sent, 120);
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(SentRecords(), sent);
}

TEST_F(SyncActorTest, IsSilentWhenAllIsDone) {
  InsertAll(20);
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(10));
  const std::uint64_t bytes = team_.radio_bytes();
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(team_.radio_bytes(), bytes);
}

TEST_F(SyncActorTest, AsksAgainUntilAnAbsentAgentAnswers) {
  InsertAll(20);
  team_.SetLink(kLeader, 3, false);
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(minutes(5));
  EXPECT_EQ(stores_[kLeader]->records().size(), 60u);
  team_.SetLink(kLeader, 3, true);
  // The session resumes as soon as the link is up, without waiting for its resend delay.
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(LeaderHasAll(20));
}

TEST_F(SyncActorTest, ContinuesAfterALinkFailureThatWasNotReported) {
  InsertAll(200);
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(milliseconds(3));
  team_.SetLink(kLeader, 2, false, /*tell=*/false);
  team_.AdvanceTime(minutes(1));
  EXPECT_FALSE(LeaderHasAll(200));
  team_.SetLink(kLeader, 2, true, /*tell=*/false);
  team_.AdvanceTime(seconds(31));
  EXPECT_TRUE(LeaderHasAll(200));
}

TEST_F(SyncActorTest, ContinuesAfterTheLeadersCrash) {
  InsertAll(200);
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  ASSERT_TRUE(team_.RunUntil([&] { return stores_[kLeader]->records().size() > 300; }, seconds(10)));
  ASSERT_FALSE(LeaderHasAll(200));
  team_.Crash(kLeader);
  team_.AdvanceTime(seconds(3));
  team_.Restart(kLeader);
  team_.AdvanceTime(minutes(1));
  EXPECT_TRUE(LeaderHasAll(200));
}

TEST_F(SyncActorTest, RefillsALeaderThatLostItsDisk) {
  InsertAll(20);
  Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(1));
  *stores_[kLeader] = MemoryStore();
  Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(stores_[kLeader]->records().size(), 20u);
}

TEST_F(SyncActorTest, RedirectsAnUnfinishedSyncToTheNewLeader) {
  InsertAll(20);
  team_.SetLink(2, kLeader, false);
  Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  NotifyRoles(team_, config_, 2, Roles(3, 2, 5));
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(stores_[3]->records().size(), 40u);
  EXPECT_EQ(stores_[kLeader]->records().size(), 20u);
}

TEST_F(SyncActorTest, RefusesInvalidOrders) {
  proto::Message order = ShareOrder(proto::SHARING_KIND_SYNC);
  order.mutable_share_request()->add_from_agents(3);
  EXPECT_EQ(Share(team_, 2, order).error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_EQ(Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC, 2)).error().code(), proto::ERROR_CODE_INVALID);
  EXPECT_EQ(Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC, 9)).error().code(), proto::ERROR_CODE_INVALID);
}

TEST_F(SyncActorTest, IgnoresMessagesFromOutsideTheTeamAndLocalMessagesFromPeers) {
  proto::Message order = ShareOrder(proto::SHARING_KIND_SYNC, kLeader);
  (void)team_.Post({9, actor_name::kSync}, {2, actor_name::kSync}, order);
  proto::Message roles;
  *roles.mutable_roles_changed()->mutable_roles() = Roles(3, 0, 100);
  (void)team_.Post({3, actor_name::kRole}, {2, actor_name::kSync}, roles);
  stores_[2]->Insert(2, proto::POSE_GRAPH_NODE, "own");
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(stores_[kLeader]->records().empty());
  Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(stores_[3]->records().empty());
  EXPECT_EQ(stores_[kLeader]->records().size(), 1u);
}

TEST_F(SyncActorTest, SendsNoMessagesToRoleActors) {
  NotifyRoles(team_, config_, 2, Roles(1, 3, 8));
  Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(team_.TakeMessages({kLeader, actor_name::kRole}).empty());
}

// Each run has a random lossy radio, which then becomes reliable. All records must arrive.
class SyncActorRadioTest : public testing::TestWithParam<int> {};

TEST_P(SyncActorRadioTest, ConvergesOverALossyRadio) {
  for (int i = 0; i < 10; ++i) {
    const auto seed = static_cast<std::uint64_t>(GetParam() * 10 + i);
    SCOPED_TRACE("seed " + std::to_string(seed));
    MemoryTeam team(seed);
    std::mt19937_64 rng(seed);
    simulation::RadioOptions& radio = team.team_.radio();
    radio.latency_jitter = milliseconds(rng() % 300);
    radio.loss_ratio = static_cast<double>(rng() % 40) / 100;
    radio.duplicate_ratio = static_cast<double>(rng() % 30) / 100;
    radio.bytes_per_second = rng() % 2 == 0 ? 0 : 20'000;
    team.InsertAll(100);
    Share(team.team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
    team.team_.AdvanceTime(seconds(60));
    radio.loss_ratio = 0;
    radio.duplicate_ratio = 0;
    team.team_.AdvanceTime(seconds(120));
    EXPECT_TRUE(team.LeaderHasAll(100));
    const std::uint64_t bytes = team.team_.radio_bytes();
    team.team_.AdvanceTime(minutes(10));
    EXPECT_EQ(team.team_.radio_bytes(), bytes) << "no byte is sent permanently";
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, SyncActorRadioTest, testing::Range(0, 5));

}  // namespace
}  // namespace moondb
