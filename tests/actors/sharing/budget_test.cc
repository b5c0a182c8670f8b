// Tests the radio's budget, which limits the bytes that all sessions of one agent send and receive together. Also tests
// the periodic sharing of states.
#include <gtest/gtest.h>

#include <deque>
#include <map>
#include <random>

#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/memory_store.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

constexpr AgentId kLeader = 1;
constexpr double kBudget = 20'000;  // Bytes per second.

class BudgetTest : public testing::Test {
 protected:
  void Start(const proto::RadioConfig& radio) {
    *config_.mutable_radio() = radio;
    for (AgentId agent = 1; agent <= 4; ++agent) stores_[agent] = AddMemoryAgent(team_, agent, config_);
    team_.SetFilter([this](AgentId from, AgentId to, const proto::Message& message) {
      if (!message.has_batch()) return true;
      batches_.push_back({team_.now(), from, to, static_cast<double>(message.ByteSizeLong())});
      return true;
    });
    team_.AdvanceTime(seconds(1));
  }

  static proto::RadioConfig Radio(double states_period_s = 0) {
    proto::RadioConfig radio;
    radio.set_budget_kbps(kBudget * 8 / 1000);
    radio.set_states_period_s(states_period_s);
    return radio;
  }

  // Inserts `bytes` of random content, which no codec can compress, in records of 200 bytes.
  void InsertNoise(AgentId agent, std::size_t bytes) {
    std::mt19937_64 random(agent);
    for (std::size_t i = 0; i < bytes / 200; ++i) {
      std::string content(200, '\0');
      for (char& byte : content) byte = static_cast<char>(random());
      stores_[agent]->Insert(agent, proto::POSE_GRAPH_NODE, content);
    }
  }

  // Returns the highest number of bytes that the agent sent and received in batches within any ten seconds.
  double MostInTenSeconds(AgentId agent) const {
    std::deque<const Sent*> window;
    double bytes = 0;
    double most = 0;
    for (const Sent& sent : batches_) {
      if (sent.from != agent && sent.to != agent) continue;
      window.push_back(&sent);
      bytes += sent.bytes;
      while (sent.time - window.front()->time > seconds(10)) {
        bytes -= window.front()->bytes;
        window.pop_front();
      }
      most = std::max(most, bytes);
    }
    return most;
  }

  struct Sent {
    MonotonicTime time;
    AgentId from;
    AgentId to;
    double bytes;
  };
  proto::TeamConfig config_ = TestTeam(3);
  std::map<AgentId, std::shared_ptr<MemoryStore>> stores_;
  std::vector<Sent> batches_;
  simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(BudgetTest, AllSessionsOfTheLeaderShareIt) {
  Start(Radio());
  InsertNoise(1, 200'000);
  InsertNoise(2, 200'000);
  InsertNoise(3, 200'000);
  const MonotonicTime start = team_.now();
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_REPLICATION));
  // The leader receives the 2,000 records of agents 2 and 3. The survivor receives at least 1,000 records from the
  // leader.
  ASSERT_TRUE(team_.RunUntil(
      [&] { return stores_[kLeader]->records().size() == 3000 && stores_[2]->records().size() >= 2000; }, minutes(10)));
  double bytes = 0;
  for (const Sent& sent : batches_) bytes += sent.bytes;
  const double seconds_taken = std::chrono::duration<double>(team_.now() - start).count();
  EXPECT_LE(MostInTenSeconds(kLeader), 10 * kBudget + 4 * 8 * 1024);
  EXPECT_GT(bytes / seconds_taken, 0.7 * kBudget) << "what one session leaves, others have";
}

TEST_F(BudgetTest, ASingleSessionUsesAllOfIt) {
  Start(Radio());
  InsertNoise(3, 200'000);
  const MonotonicTime start = team_.now();
  Share(team_, 3, ShareOrder(proto::SHARING_KIND_SYNC));
  ASSERT_TRUE(team_.RunUntil([&] { return stores_[kLeader]->records().size() == 1000; }, minutes(10)));
  EXPECT_LT(team_.now() - start, seconds(14));
  EXPECT_LE(MostInTenSeconds(3), 10 * kBudget + 8 * 1024 + 4096);
}

TEST_F(BudgetTest, ASenderThatVanishesReturnsItsShare) {
  Start(Radio());
  InsertNoise(2, 400'000);
  InsertNoise(3, 200'000);
  Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  Share(team_, 3, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(2));
  team_.Crash(3);
  team_.AdvanceTime(seconds(10));
  const MonotonicTime start = team_.now();
  const std::size_t before = stores_[kLeader]->records().size();
  team_.AdvanceTime(seconds(10));
  EXPECT_GT(stores_[kLeader]->records().size(), before + 800) << "200 kB hold 1000";
  EXPECT_EQ(team_.now() - start, seconds(10));
}

TEST_F(BudgetTest, LatestStatesReachTheLeaderPeriodically) {
  Start(Radio(/*states_period_s=*/30));
  stores_[3]->Insert(3, proto::POWER, "p");
  stores_[3]->Insert(3, proto::POSE_GRAPH_NODE, "n");
  team_.AdvanceTime(seconds(31));
  EXPECT_EQ(stores_[kLeader]->records().size(), 1u) << "the state alone";
  stores_[3]->Insert(3, proto::POWER, "q");
  team_.AdvanceTime(seconds(31));
  EXPECT_EQ(stores_[kLeader]->records().size(), 2u);

  team_.SetLink(3, kLeader, false);
  team_.AdvanceTime(minutes(1));
  const proto::ShareStatus status = ShareStatusOf(team_, 3, actor_name::kSync);
  EXPECT_FALSE(status.sessions(0).is_open()) << "out of reach nothing is begun";
}

TEST_F(BudgetTest, AnOpenOrderContinuesWhenStatesAreDue) {
  Start(Radio(/*states_period_s=*/5));
  InsertNoise(3, 400'000);
  Share(team_, 3, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(12));
  stores_[3]->Insert(3, proto::POWER, "p");
  ASSERT_TRUE(team_.RunUntil([&] { return stores_[kLeader]->records().size() == 2001; }, minutes(1)));
}

TEST_F(BudgetTest, ARoleChangeDoesNotTurnPeriodicStatesIntoAFullSync) {
  Start(Radio(/*states_period_s=*/30));
  stores_[3]->Insert(3, proto::POWER, "p");
  InsertNoise(3, 100'000);
  team_.SetFilter([this](AgentId from, AgentId, const proto::Message& message) {
    return !(message.has_hello() && from == 3 && stores_[kLeader]->records().empty());
  });
  // No Hello from agent 3 arrives. Its periodic session to the leader therefore stays open.
  team_.AdvanceTime(seconds(31));
  ASSERT_TRUE(ShareStatusOf(team_, 3, actor_name::kSync).sessions(0).is_periodic());
  for (AgentId agent = 1; agent <= 4; ++agent) NotifyRoles(team_, config_, agent, Roles(2, 1, 5));
  team_.AdvanceTime(seconds(20));
  EXPECT_TRUE(stores_[2]->records().empty());
}

TEST_F(BudgetTest, ARestartedSharingActorSharesTheBudgetAgain) {
  Start(Radio());
  InsertNoise(2, 400'000);
  InsertNoise(3, 400'000);
  Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  proto::Message order = ShareOrder(proto::SHARING_KIND_REPLICATION, /*destination=*/kLeader);
  Share(team_, 3, order);
  team_.AdvanceTime(seconds(3));
  const auto rate = [this](AgentId agent, const char* actor) {
    return ShareStatusOf(team_, agent, actor).sessions(0).bytes_per_second_max();
  };
  EXPECT_EQ(rate(2, actor_name::kSync), kBudget / 2);
  // The leader's replica actor restarts and has no senders, because the link to agent 3 is down. The sync actor then
  // grants agent 2 the whole budget.
  team_.CrashActor({kLeader, actor_name::kReplica});
  team_.SetLink(3, kLeader, false);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(rate(2, actor_name::kSync), kBudget);
  // The replica actor restarts again. It then learns that the sync actor serves one sender, and grants agent 3 half of
  // the budget.
  team_.CrashActor({kLeader, actor_name::kReplica});
  team_.AdvanceTime(seconds(1));
  team_.SetLink(3, kLeader, true);
  team_.AdvanceTime(seconds(8));
  EXPECT_EQ(rate(3, actor_name::kReplica), kBudget / 2);
}

}  // namespace
}  // namespace moondb
