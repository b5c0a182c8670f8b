// Tests the sharing window. While the sender or the destination of a session has a lease for driving, sleeping or a
// pause, the window is shut and the session waits.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "actors/lease/lease_actor.h"
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

proto::TeamConfig QuietTeam(bool is_quiet_while_driving) {
  proto::TeamConfig team = TestTeam(3);
  team.mutable_radio()->set_quiet_while_driving(is_quiet_while_driving);
  return team;
}

// A team with records in memory: agents 1 (leader), 2 and 3 are rovers, and 4 is the base station.
class WindowTeam {
 public:
  explicit WindowTeam(std::uint64_t seed, bool is_quiet_while_driving = true)
      : config_(QuietTeam(is_quiet_while_driving)), team_(seed) {
    for (AgentId agent = 1; agent <= 4; ++agent) stores_[agent] = AddMemoryAgent(team_, agent, config_);
    for (AgentId agent = 1; agent <= 4; ++agent) {
      LeaseActor::Options options;
      options.self = agent;
      options.team = config_;
      team_.Spawn(agent, actor_name::kLease, [options] { return std::make_unique<LeaseActor>(options); });
    }
    team_.AdvanceTime(seconds(1));
    team_.SetFilter([this](AgentId from, AgentId, const proto::Message& message) {
      if (message.has_batch() && message.data_type() != proto::POWER) {
        ++bulky_;
        if (team_.now() < quiet_until_[from]) ++bulky_by_quiet_;
      }
      return true;
    });
  }

  void SetLease(AgentId agent, proto::LeaseKind kind, int duration_s) {
    proto::Message message;
    message.mutable_lease_request()->set_kind(kind);
    message.mutable_lease_request()->set_seconds(duration_s);
    (void)team_.Post({agent, actor_name::kGateway}, {agent, actor_name::kLease}, message);
    team_.RunUntilIdle();
    quiet_until_[agent] = team_.now() + seconds(duration_s);
  }
  void Drive(AgentId agent, int duration_s) { SetLease(agent, proto::LEASE_KIND_DRIVING, duration_s); }
  void Sleep(AgentId agent, int duration_s) { SetLease(agent, proto::LEASE_KIND_SLEEPING, duration_s); }
  void Pause(AgentId agent, int duration_s) { SetLease(agent, proto::LEASE_KIND_PAUSED, duration_s); }

  void Insert(AgentId agent, int count) {
    for (int i = 0; i < count; ++i) {
      stores_[agent]->Insert(agent, proto::POSE_GRAPH_NODE, "node " + std::to_string(i) + std::string(100, 'x'));
    }
  }

  std::size_t HeldByLeader() { return stores_[kLeader]->records().size(); }

  std::string WaitsFor(AgentId agent, const char* actor = actor_name::kSync) {
    const proto::ShareStatus status = ShareStatusOf(team_, agent, actor);
    return status.sessions().empty() ? "no session" : status.sessions(0).waits_for();
  }

  const proto::TeamConfig config_;
  std::map<AgentId, std::shared_ptr<MemoryStore>> stores_;
  std::map<AgentId, MonotonicTime> quiet_until_;
  int bulky_ = 0;           // Number of sent batches of types other than POWER.
  int bulky_by_quiet_ = 0;  // Number of the batches in `bulky_` that agents sent during a lease.
  simulation::SimulatedTeam team_;
};

class WindowTest : public testing::Test, protected WindowTeam {
 protected:
  WindowTest() : WindowTeam(/*seed=*/1) {}

  // Inserts 500 records (50 kB) that no codec can compress. Limits the radio to 20 kB/s.
  void InsertMuchInto(AgentId agent) {
    team_.radio().bytes_per_second = 20'000;
    std::mt19937_64 random(1);
    for (int i = 0; i < 500; ++i) {
      std::string content(100, '\0');
      for (char& byte : content) byte = static_cast<char>(random());
      stores_[agent]->Insert(agent, proto::POSE_GRAPH_NODE, content);
    }
  }

  // Runs rover 2's session to the leader until the leader holds more than 100 of the 500 records.
  void ShareUntilTheMiddle() {
    InsertMuchInto(2);
    Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
    ASSERT_TRUE(team_.RunUntil([&] { return HeldByLeader() > 100; }, seconds(10)));
    ASSERT_LT(HeldByLeader(), 500u);
  }

  void BeginTermOfTheLeader() {
    team_.RecordSent({kLeader, actor_name::kReplica});
    for (AgentId agent = 1; agent <= 4; ++agent) NotifyRoles(team_, config_, agent, Roles(1, 2, 5));
  }

  // Returns the agents to which the leader's ReplicaActor sent an order since the last call.
  std::vector<AgentId> Asked() {
    std::vector<AgentId> asked;
    for (const proto::Message& message : team_.TakeSent({kLeader, actor_name::kReplica})) {
      if (message.has_share_request()) asked.push_back(message.destination_id());
    }
    return asked;
  }

  // Lets batches in flight arrive for 2 s. Then expects no more batches until `duration` has passed.
  void ExpectSilence(seconds duration) {
    team_.AdvanceTime(seconds(2));
    const int bulky = bulky_;
    const std::size_t held = HeldByLeader();
    EXPECT_LT(held, 500u);
    team_.AdvanceTime(duration - seconds(2));
    EXPECT_EQ(bulky_, bulky);
    EXPECT_EQ(HeldByLeader(), held);
  }
};

TEST_F(WindowTest, ADrivingSenderPausesATransferAndResumesByItself) {
  ShareUntilTheMiddle();
  Drive(2, 60);
  ExpectSilence(seconds(59));
  EXPECT_EQ(bulky_by_quiet_, 0);
  team_.AdvanceTime(seconds(30));
  EXPECT_EQ(HeldByLeader(), 500u);
  EXPECT_EQ(WaitsFor(2), "");
}

TEST_F(WindowTest, NothingIsSentToADrivingReceiver) {
  ShareUntilTheMiddle();
  Drive(kLeader, 60);
  ExpectSilence(seconds(59));
  EXPECT_THAT(WaitsFor(2), testing::StartsWith("rover1 drives for "));
  team_.AdvanceTime(seconds(30));
  EXPECT_EQ(HeldByLeader(), 500u);
}

TEST_F(WindowTest, OpensAtOnceWhenTheDriveEndsEarly) {
  ShareUntilTheMiddle();
  Drive(2, 3600);
  ExpectSilence(seconds(100));
  Drive(2, 0);
  team_.AdvanceTime(seconds(30));
  EXPECT_EQ(HeldByLeader(), 500u);
}

TEST_F(WindowTest, APausedAgentSendsAndReceivesNothingButStates) {
  stores_[2]->Insert(2, proto::POWER, "full");
  ShareUntilTheMiddle();
  Pause(2, 60);
  ExpectSilence(seconds(59));
  EXPECT_EQ(bulky_by_quiet_, 0);
  EXPECT_THAT(WaitsFor(2), testing::StartsWith("rover2 is paused for "));
  team_.AdvanceTime(seconds(30));
  EXPECT_EQ(HeldByLeader(), 501u);

  Insert(3, 20);
  stores_[3]->Insert(3, proto::POWER, "full");
  Pause(kLeader, 3600);
  team_.AdvanceTime(seconds(1));
  Share(team_, 3, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(minutes(5));
  EXPECT_EQ(HeldByLeader(), 502u) << "the state";
  Pause(kLeader, 0);
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(HeldByLeader(), 522u);
}

TEST_F(WindowTest, AnOrderWaitsAndReportsTheReason) {
  Insert(2, 20);
  Drive(2, 40);
  EXPECT_EQ(Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC)).session_count(), 1u);
  EXPECT_EQ(WaitsFor(2), "rover2 drives for 40 s more");
  team_.AdvanceTime(seconds(39));
  EXPECT_EQ(bulky_, 0);
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(HeldByLeader(), 20u);
}

TEST_F(WindowTest, AnOrderTransfersTheStatesOfADrivingAgentButNotOfASleepingOne) {
  for (const AgentId agent : {2, 3}) {
    stores_[agent]->Insert(agent, proto::POWER, "full");
    Insert(agent, 20);
  }
  Drive(2, 600);
  Sleep(3, 600);
  team_.AdvanceTime(seconds(1));
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(100));
  EXPECT_EQ(HeldByLeader(), 1u);
  EXPECT_THAT(WaitsFor(2), testing::StartsWith("rover2 drives for "));
  team_.AdvanceTime(seconds(510));
  EXPECT_EQ(HeldByLeader(), 42u);
}

TEST_F(WindowTest, TheLeaderCollectsFromAgentsThatDoNotDrive) {
  for (AgentId agent = 2; agent <= 4; ++agent) Insert(agent, 20);
  Drive(3, 3000);
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(HeldByLeader(), 40u);
  team_.AdvanceTime(minutes(41));
  EXPECT_EQ(HeldByLeader(), 60u);
}

TEST_F(WindowTest, ReplicationWaitsForTheWindowToo) {
  Insert(kLeader, 20);
  Sleep(2, 40);
  team_.AdvanceTime(seconds(1));
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_REPLICATION));
  EXPECT_THAT(WaitsFor(kLeader, actor_name::kReplica), testing::StartsWith("rover2 sleeps for "));
  team_.AdvanceTime(seconds(38));
  EXPECT_EQ(bulky_, 0);
  team_.AdvanceTime(seconds(3));
  EXPECT_EQ(stores_[2]->records().size(), 20u);
}

TEST_F(WindowTest, ANewLeaderAsksADrivingAgentOnceItStops) {
  Insert(3, 20);
  Drive(3, 3600);
  Sleep(2, 3600);
  team_.AdvanceTime(seconds(1));
  BeginTermOfTheLeader();
  team_.AdvanceTime(minutes(50));
  EXPECT_EQ(Asked(), std::vector<AgentId>{4}) << "nobody else, and nobody again and again";
  EXPECT_EQ(HeldByLeader(), 0u);
  team_.AdvanceTime(minutes(15));
  EXPECT_EQ(HeldByLeader(), 20u);
}

TEST_F(WindowTest, ANewLeaderAsksTheNextAgentWhenTheFirstBeginsToDrive) {
  InsertMuchInto(2);
  BeginTermOfTheLeader();
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(Asked(), std::vector<AgentId>{2});
  Drive(2, 600);
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(Asked(), (std::vector<AgentId>{3, 4}));
}

TEST_F(WindowTest, ARestartedSharingActorKnowsTheLeases) {
  Insert(2, 20);
  Drive(2, 600);
  team_.CrashActor({2, actor_name::kSync});
  team_.AdvanceTime(seconds(1));
  Share(team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  team_.AdvanceTime(seconds(100));
  EXPECT_EQ(bulky_, 0);
}

TEST(WindowConfigTest, ATeamWithoutRadioSilenceWhileDrivingWaitsOnlyForSleepersAndPauses) {
  WindowTeam team(/*seed=*/1, /*is_quiet_while_driving=*/false);
  team.Insert(2, 20);
  team.Drive(2, 600);
  Share(team.team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  team.team_.AdvanceTime(seconds(2));
  EXPECT_EQ(team.HeldByLeader(), 20u);
  team.Insert(2, 20);
  team.Sleep(2, 600);
  Share(team.team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  team.team_.AdvanceTime(seconds(2));
  EXPECT_EQ(team.HeldByLeader(), 20u);
  team.Sleep(2, 0);
  team.team_.AdvanceTime(seconds(2));
  team.Pause(2, 600);
  team.Insert(2, 20);
  Share(team.team_, 2, ShareOrder(proto::SHARING_KIND_SYNC));
  team.team_.AdvanceTime(minutes(9));
  EXPECT_EQ(team.HeldByLeader(), 40u) << "what waited for the sleeper, and nothing else";
}

// Each run has random drives, sleeps and pauses over a lossy radio, which then becomes reliable. No bulk data may be
// sent during a lease, and all records must arrive.
class WindowRadioTest : public testing::TestWithParam<int> {};

TEST_P(WindowRadioTest, LosesNoRecordWhileWindowsOpenAndShut) {
  for (int i = 0; i < 10; ++i) {
    const auto seed = static_cast<std::uint64_t>(GetParam() * 10 + i);
    SCOPED_TRACE("seed " + std::to_string(seed));
    WindowTeam team(seed);
    std::mt19937_64 rng(seed);
    simulation::RadioOptions& radio = team.team_.radio();
    radio.latency_jitter = milliseconds(rng() % 300);
    radio.loss_ratio = static_cast<double>(rng() % 40) / 100;
    radio.duplicate_ratio = static_cast<double>(rng() % 30) / 100;
    radio.bytes_per_second = 5'000;
    for (AgentId agent = 1; agent <= 4; ++agent) team.Insert(agent, 100);
    Share(team.team_, kLeader, ShareOrder(proto::SHARING_KIND_SYNC));
    for (int step = 0; step < 20; ++step) {
      const auto agent = static_cast<AgentId>(1 + rng() % 4);
      constexpr proto::LeaseKind kKinds[] = {proto::LEASE_KIND_SLEEPING, proto::LEASE_KIND_DRIVING,
                                             proto::LEASE_KIND_PAUSED};
      const auto kind = kKinds[rng() % std::size(kKinds)];
      if (team.team_.now() >= team.quiet_until_[agent]) team.SetLease(agent, kind, static_cast<int>(rng() % 20));
      team.team_.AdvanceTime(milliseconds(rng() % 8000));
    }
    EXPECT_EQ(team.bulky_by_quiet_, 0);
    radio = simulation::RadioOptions();
    team.team_.AdvanceTime(minutes(2));
    EXPECT_EQ(team.HeldByLeader(), 400u);
    const std::uint64_t bytes = team.team_.radio_bytes();
    team.team_.AdvanceTime(minutes(10));
    EXPECT_EQ(team.team_.radio_bytes(), bytes) << "no byte is sent permanently";
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, WindowRadioTest, testing::Range(0, 5));

}  // namespace
}  // namespace moondb
