#include "actors/lease/lease_actor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "model/control_message.h"
#include "proto/control.pb.h"
#include "runtime/simulation/simulated_team.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

constexpr AgentId kAgents = 3;
constexpr auto kDriving = proto::LEASE_KIND_DRIVING;
constexpr auto kSleeping = proto::LEASE_KIND_SLEEPING;
constexpr auto kPaused = proto::LEASE_KIND_PAUSED;

// A team of rovers 1 to 3, each of which runs only a LeaseActor. The tests send the messages of the other actors.
class LeaseTeam {
 public:
  explicit LeaseTeam(std::uint64_t seed) : team_(seed) {
    config_.set_team("test");
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      config_.add_agents()->set_id(agent);
      team_.AddAgent(agent);
      team_.Watch({agent, "planner"}, Topic::kLeases);
    }
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      LeaseActor::Options options;
      options.self = agent;
      options.team = config_;
      team_.Spawn(agent, actor_name::kLease, [options] { return std::make_unique<LeaseActor>(options); });
    }
    team_.AdvanceTime(seconds(1));
  }

  proto::LeaseReply Set(AgentId agent, proto::LeaseKind kind, double duration_s) {
    proto::Message message;
    message.mutable_lease_request()->set_kind(kind);
    message.mutable_lease_request()->set_seconds(duration_s);
    (void)team_.Post({agent, actor_name::kGateway}, {agent, actor_name::kLease}, message);
    const auto answer = team_.Expect({agent, actor_name::kGateway}, proto::Message::kLeaseReply, milliseconds(1));
    return answer ? answer->lease_reply() : proto::LeaseReply();
  }

  // Returns the remaining driving and sleeping times of `other` that `agent` knows, in whole seconds.
  std::pair<long, long> Known(AgentId agent, AgentId other) {
    const proto::AgentLease lease = LeaseKnown(agent, other);
    return {std::lround(lease.driving_s()), std::lround(lease.sleeping_s())};
  }
  long KnownPause(AgentId agent, AgentId other) { return std::lround(LeaseKnown(agent, other).paused_s()); }

  proto::AgentLease LeaseKnown(AgentId agent, AgentId other) {
    proto::ControlRequest question;
    question.mutable_status();
    (void)team_.Post({agent, "requester"}, {agent, actor_name::kLease}, MessageOf(question));
    const auto message = team_.Expect({agent, "requester"}, proto::Message::kControlReply, milliseconds(1));
    EXPECT_TRUE(message);
    if (!message) return {};
    const auto answer = ControlReplyOf(*message);
    EXPECT_TRUE(answer);
    if (!answer) return {};
    for (const proto::AgentLease& lease : answer->status().leases()) {
      if (lease.agent_id() == other) return lease;
    }
    return {};
  }

  bool AllKnow(AgentId agent, std::pair<long, long> lease) {
    for (AgentId other = 1; other <= kAgents; ++other) {
      if (Known(other, agent) != lease) return false;
    }
    return true;
  }

  proto::TeamConfig config_;
  simulation::SimulatedTeam team_;
};

class LeaseActorTest : public testing::Test, protected LeaseTeam {
 protected:
  LeaseActorTest() : LeaseTeam(/*seed=*/1) {}

  void Announce(AgentId from, AgentId to, std::uint64_t number, double driving_s, double sleeping_s = 0,
                double paused_s = 0) {
    proto::Message message;
    message.mutable_lease_announce()->set_number(number);
    message.mutable_lease_announce()->set_driving_s(driving_s);
    message.mutable_lease_announce()->set_sleeping_s(sleeping_s);
    message.mutable_lease_announce()->set_paused_s(paused_s);
    (void)team_.Post({from, actor_name::kLease}, {to, actor_name::kLease}, message);
    team_.AdvanceTime(milliseconds(10));
  }
};

TEST_F(LeaseActorTest, NotifiesTheWholeTeamAtOnceAndCountsDownEverywhere) {
  const auto reply = Set(2, kDriving, 40);
  ASSERT_EQ(reply.leases_size(), 1);
  EXPECT_EQ(reply.leases(0).agent_id(), 2u);
  EXPECT_EQ(reply.leases(0).driving_s(), 40);
  team_.AdvanceTime(milliseconds(10));
  EXPECT_TRUE(AllKnow(2, {40, 0}));
  Set(2, kSleeping, 3600);
  team_.AdvanceTime(seconds(30));
  EXPECT_TRUE(AllKnow(2, {10, 3570}));
  team_.AdvanceTime(seconds(11));
  EXPECT_TRUE(AllKnow(2, {0, 3559}));
  EXPECT_TRUE(AllKnow(1, {0, 0}));
}

TEST_F(LeaseActorTest, NotifiesTheTeamOfAPauseBesideTheOtherLeases) {
  Set(2, kDriving, 40);
  EXPECT_EQ(Set(2, kPaused, 600).leases(0).paused_s(), 600);
  team_.AdvanceTime(seconds(50));
  for (AgentId agent = 1; agent <= kAgents; ++agent) {
    EXPECT_EQ(KnownPause(agent, 2), 550) << agent;
    EXPECT_EQ(Known(agent, 2), std::pair(0L, 0L)) << agent;
  }
  team_.TakeMessages({1, "planner"});
  const auto expired = team_.Expect({1, "planner"}, proto::Message::kLeasesChanged, minutes(10));
  ASSERT_TRUE(expired);
  EXPECT_TRUE(expired->leases_changed().leases().empty());
  Set(2, kPaused, 600);
  EXPECT_EQ(Set(2, kPaused, 0).leases_size(), 0);
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(KnownPause(1, 2), 0);
}

TEST_F(LeaseActorTest, EndsEarlyAtItsRobotsRequest) {
  Set(2, kDriving, 3600);
  team_.AdvanceTime(seconds(5));
  EXPECT_EQ(Set(2, kDriving, 0).leases_size(), 0);
  team_.AdvanceTime(milliseconds(10));
  EXPECT_TRUE(AllKnow(2, {0, 0}));
}

TEST_F(LeaseActorTest, RefusesBadDurationsAndKinds) {
  for (const double bad : {-1., 86401., std::nan("")}) {
    const proto::LeaseReply reply = Set(2, kDriving, bad);
    EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_INVALID) << bad;
    EXPECT_EQ(reply.error().field(), "lease.seconds") << bad;
  }
  EXPECT_EQ(Set(2, proto::LEASE_KIND_UNSPECIFIED, 5).error().field(), "lease.kind");
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(AllKnow(2, {0, 0}));
}

TEST_F(LeaseActorTest, PublishesEachChangeAndExpiry) {
  team_.TakeMessages({1, "planner"});
  Set(2, kDriving, 40);
  const auto begun = team_.Expect({1, "planner"}, proto::Message::kLeasesChanged, seconds(1));
  ASSERT_TRUE(begun);
  EXPECT_EQ(begun->leases_changed().leases(0).agent_id(), 2u);
  EXPECT_EQ(begun->leases_changed().as_of_ns(), team_.now().time_since_epoch().count());
  const MonotonicTime start = team_.now();
  const auto expired = team_.Expect({1, "planner"}, proto::Message::kLeasesChanged, minutes(1));
  ASSERT_TRUE(expired);
  EXPECT_TRUE(expired->leases_changed().leases().empty());
  EXPECT_EQ(team_.now() - start, seconds(40));
}

TEST_F(LeaseActorTest, ALateSubscriberGetsTheRemainingTime) {
  Set(2, kDriving, 40);
  team_.AdvanceTime(seconds(30));
  team_.Watch({1, "late"}, Topic::kLeases);
  const auto message = team_.Expect({1, "late"}, proto::Message::kLeasesChanged, milliseconds(1));
  ASSERT_TRUE(message);
  Leases leases(/*is_quiet_while_driving=*/true);
  leases.SetAll(message->leases_changed());
  EXPECT_NEAR(leases.LeftOf(2, team_.now()).driving_s(), 10, 0.1);
}

TEST_F(LeaseActorTest, NotifiesAnAgentThatWasAwayWhenItReconnects) {
  team_.SetLink(1, 2, false);
  Set(2, kDriving, 600);
  team_.AdvanceTime(seconds(100));
  EXPECT_EQ(Known(1, 2), std::pair(0L, 0L));
  team_.SetLink(1, 2, true);
  team_.AdvanceTime(milliseconds(10));
  EXPECT_EQ(Known(1, 2), std::pair(500L, 0L));
}

TEST_F(LeaseActorTest, ResendsALostAnnouncement) {
  team_.SetLink(1, 2, false, /*tell=*/false);
  Set(2, kDriving, 600);
  team_.AdvanceTime(seconds(3));
  team_.SetLink(1, 2, true, /*tell=*/false);
  team_.AdvanceTime(seconds(3));
  EXPECT_TRUE(AllKnow(2, {594, 0}));
}

TEST_F(LeaseActorTest, IsSilentOnceAllAgentsHaveConfirmed) {
  Set(2, kDriving, 600);
  team_.AdvanceTime(seconds(1));
  const std::uint64_t bytes = team_.radio_bytes();
  team_.AdvanceTime(minutes(30));  // The lease expires during this time. Nothing is sent.
  EXPECT_EQ(team_.radio_bytes(), bytes);
}

TEST_F(LeaseActorTest, RefusesAnnouncementsOutOfBounds) {
  for (const double bad : {-1., 86401., std::nan("")}) {
    Announce(2, 1, 7, bad);
    Announce(2, 1, 7, 5, bad);
    Announce(2, 1, 7, 5, 5, bad);
  }
  Announce(9, 1, 7, 5);  // Agent 9 is not in the team.
  EXPECT_EQ(Known(1, 2), std::pair(0L, 0L));
  EXPECT_EQ(Known(1, 9), std::pair(0L, 0L));
}

TEST_F(LeaseActorTest, AcceptsRequestsAndEventsOnlyFromItsOwnAgent) {
  proto::Message request;
  request.mutable_lease_request()->set_kind(kDriving);
  request.mutable_lease_request()->set_seconds(50);
  (void)team_.Post({2, actor_name::kLease}, {1, actor_name::kLease}, request);
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(Known(1, 1), std::pair(0L, 0L));
}

TEST_F(LeaseActorTest, IgnoresALateAnnouncement) {
  // The radio loses all messages to agent 2. Otherwise agent 2 would correct the announcements that the test sends in
  // its name.
  team_.SetFilter([](AgentId, AgentId to, const proto::Message&) { return to != 2; });
  Announce(2, 1, 500, 100);
  Announce(2, 1, 501, 0);
  Announce(2, 1, 500, 100);
  EXPECT_EQ(Known(1, 2), std::pair(0L, 0L));
  Announce(2, 1, 502, 60);
  team_.AdvanceTime(seconds(20));
  Announce(2, 1, 502, 60);  // A repeated announcement does not extend the lease. The time counts from the first copy.
  EXPECT_EQ(Known(1, 2), std::pair(40L, 0L));
}

TEST_F(LeaseActorTest, ARestartedAgentIsAwakeAndLearnsTheOthersLeases) {
  Set(2, kSleeping, 3600);
  Set(3, kDriving, 600);
  team_.AdvanceTime(seconds(1));
  team_.CrashActor({2, actor_name::kLease});
  team_.AdvanceTime(seconds(9));
  EXPECT_TRUE(AllKnow(2, {0, 0}));
  EXPECT_TRUE(AllKnow(3, {590, 0}));
}

TEST_F(LeaseActorTest, CorrectsALateAnnouncementFromBeforeTheRestart) {
  Announce(2, 1, 12345, 3600);
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(Known(1, 2), std::pair(0L, 0L));
}

// Sets random leases while actors fail, links break, and the radio loses, repeats and delays messages. Then the radio
// works, and all agents must agree on the leases.
class LeaseActorChaosTest : public testing::TestWithParam<int> {};

TEST_P(LeaseActorChaosTest, AllAgreeInTheEnd) {
  for (int i = 0; i < 10; ++i) {
    const auto seed = static_cast<std::uint64_t>(GetParam() * 10 + i);
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    LeaseTeam team(seed);
    team.team_.radio().loss_ratio = static_cast<double>(rng() % 40) / 100;
    team.team_.radio().duplicate_ratio = 0.2;
    team.team_.radio().latency_jitter = milliseconds(500);
    for (int step = 0; step < 30; ++step) {
      const auto agent = static_cast<AgentId>(1 + rng() % kAgents);
      const auto other = static_cast<AgentId>(1 + rng() % kAgents);
      switch (rng() % 4) {
        case 0:
          if (agent != other) team.team_.SetLink(agent, other, rng() % 2 == 0);
          break;
        case 1:
          team.team_.CrashActor({agent, actor_name::kLease});
          break;
        default:
          team.Set(agent, rng() % 2 == 0 ? kDriving : kSleeping, rng() % 3 == 0 ? 0 : 20'000);
      }
      team.team_.AdvanceTime(milliseconds(rng() % 8000));
    }
    team.team_.radio() = simulation::RadioOptions();
    team.team_.Heal();
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      // An agent stops if its LeaseActor fails too often.
      if (!team.team_.is_running(agent)) team.team_.Restart(agent);
    }
    team.team_.AdvanceTime(minutes(5));
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      const auto own = team.Known(agent, agent);
      for (AgentId other = 1; other <= kAgents; ++other) {
        const auto known = team.Known(other, agent);
        // An agent counts another agent's remaining time from the first announcement that it received. That
        // announcement may have been late.
        EXPECT_NEAR(known.first, own.first, 400) << agent << " as " << other << " knows it";
        EXPECT_NEAR(known.second, own.second, 400) << agent << " as " << other << " knows it";
      }
    }
    const std::uint64_t bytes = team.team_.radio_bytes();
    team.team_.AdvanceTime(minutes(10));
    EXPECT_EQ(team.team_.radio_bytes(), bytes) << "no byte is sent permanently";
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, LeaseActorChaosTest, testing::Range(0, 10));

}  // namespace
}  // namespace moondb
