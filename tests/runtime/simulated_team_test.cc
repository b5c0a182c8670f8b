#include "runtime/simulation/simulated_team.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "proto/trace.pb.h"
#include "runtime/system_status.h"
#include "tests/runtime/scripted_actor.h"

namespace moondb::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::AllOf;
using testing::ElementsAre;
using testing::Ge;
using testing::IsEmpty;
using testing::Le;
using testing::Ne;
using testing::SizeIs;

std::vector<std::uint64_t> NumbersOf(const std::vector<proto::Message>& messages) {
  std::vector<std::uint64_t> numbers;
  for (const proto::Message& message : messages) numbers.push_back(message.request_id());
  return numbers;
}

proto::RoleAssignment Roles(AgentId leader, AgentId survivor) {
  proto::RoleAssignment roles;
  roles.set_leader(leader);
  roles.set_survivor(survivor);
  return roles;
}

class SimulatedTeamTest : public testing::Test {
 protected:
  SimulatedTeamTest() : team_(/*seed=*/7) {
    for (AgentId agent : {1, 2, 3}) team_.AddAgent(agent);
  }

  // Spawns 1/relay, an actor that forwards every message to `to`, and sends one message from 1/test to 1/relay. Returns
  // the result of the forwarding Send.
  SendResult RelayOnce(const Address& to) {
    SendResult result = SendResult::kAccepted;
    team_.Spawn(1, "relay", OnEachMessage([&](Context& context, const proto::Message& message) {
                  result = context.Send(to, Numbered(message.request_id()));
                }));
    EXPECT_EQ(team_.Post({1, "test"}, {1, "relay"}, Numbered(5)), SendResult::kAccepted);
    team_.AdvanceTime(seconds(1));
    return result;
  }

  SimulatedTeam team_;
};

TEST_F(SimulatedTeamTest, AddressesAreFilledInBySend) {
  EXPECT_EQ(RelayOnce({2, "sync"}), SendResult::kAccepted);
  const std::vector<proto::Message> messages = team_.TakeMessages({2, "sync"});
  ASSERT_THAT(messages, SizeIs(1));
  EXPECT_EQ(messages[0].hop_sender(), 1u);
  EXPECT_EQ(messages[0].source_actor(), "relay");
  EXPECT_EQ(messages[0].destination_id(), 2u);
  EXPECT_EQ(messages[0].destination_actor(), "sync");
  EXPECT_EQ(messages[0].agent_id(), 1u);
}

TEST_F(SimulatedTeamTest, OriginOfForwardedDataIsKept) {
  proto::Message message = Numbered(1);
  message.set_agent_id(3);
  ASSERT_EQ(team_.Post({1, "test"}, {2, "sync"}, message), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(team_.TakeMessages({2, "sync"}).at(0).agent_id(), 3u);
}

TEST_F(SimulatedTeamTest, ReplyGoesToTheSenderWithTheRequestId) {
  team_.Spawn(2, "echo", OnEachMessage([](Context& context, const proto::Message&) {
                EXPECT_EQ(context.sender(), (Address{1, "test"}));
                EXPECT_EQ(context.Reply({}), SendResult::kAccepted);
              }));
  ASSERT_EQ(team_.Post({1, "test"}, {2, "echo"}, Numbered(42)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({1, "test"})), ElementsAre(42));
}

TEST_F(SimulatedTeamTest, ClientsGetRepliesToo) {
  team_.Spawn(1, "gateway", OnEachMessage([](Context& context, const proto::Message&) { (void)context.Reply({}); }));
  ASSERT_EQ(team_.Post({kClients, "c1"}, {1, "gateway"}, Numbered(3)), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_THAT(NumbersOf(team_.TakeMessages({kClients, "c1"})), ElementsAre(3));
  EXPECT_THAT(team_.TakeMessages({kClients, "c1"}), IsEmpty());
}

TEST_F(SimulatedTeamTest, AliasesResolveByTheRolesThatTheSendersAgentKnows) {
  team_.SetBaseStation(3);
  team_.SetRoles(1, Roles(2, 3));
  team_.SetRoles(2, Roles(1, 3));
  ASSERT_EQ(team_.Post({1, "test"}, {kLeaderAlias, "a"}, Numbered(1)), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({2, "test"}, {kLeaderAlias, "a"}, Numbered(2)), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({1, "test"}, {kSurvivorAlias, "a"}, Numbered(3)), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({1, "test"}, {kBaseAlias, "a"}, Numbered(4)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({2, "a"})), ElementsAre(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({1, "a"})), ElementsAre(2));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({3, "a"})), ElementsAre(3, 4));
}

TEST_F(SimulatedTeamTest, AliasIsResolvedWhenTheMessageIsSent) {
  team_.Spawn(1, "role", OnEachMessage([](Context& context, const proto::Message&) {
                context.SetRoles(Roles(2, 3));
                EXPECT_EQ(context.Send({kLeaderAlias, "a"}, Numbered(1)), SendResult::kAccepted);
                context.SetRoles(Roles(3, 2));
                EXPECT_EQ(context.Send({kLeaderAlias, "a"}, Numbered(2)), SendResult::kAccepted);
              }));
  ASSERT_EQ(team_.Post({1, "test"}, {1, "role"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({2, "a"})), ElementsAre(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({3, "a"})), ElementsAre(2));
}

TEST_F(SimulatedTeamTest, SendingToAnUnknownAgentFailsWithNoPeer) {
  EXPECT_EQ(team_.Post({1, "test"}, {kLeaderAlias, "a"}, {}), SendResult::kNoPeer);
  EXPECT_EQ(team_.Post({1, "test"}, {9, "a"}, {}), SendResult::kNoPeer);
  EXPECT_EQ(RelayOnce({kSurvivorAlias, "a"}), SendResult::kNoPeer);
}

TEST_F(SimulatedTeamTest, MessagesBetweenAgentsTakeTheRadiosLatency) {
  ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, Numbered(1)), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({1, "test"}, {1, "a"}, Numbered(2)), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_THAT(team_.TakeMessages({2, "a"}), IsEmpty());
  EXPECT_THAT(team_.TakeMessages({1, "a"}), SizeIs(1));
  team_.AdvanceTime(milliseconds(1));
  EXPECT_THAT(team_.TakeMessages({2, "a"}), SizeIs(1));
  EXPECT_GT(team_.radio_bytes(), 0u);
}

TEST_F(SimulatedTeamTest, RateDelaysAndThenFillsTheOutbox) {
  team_.radio().bytes_per_second = 1000;
  team_.radio().outbox_bytes_max = 2500;
  proto::Message message;
  message.set_sql(std::string(1000, 'x'));
  for (int i = 0; i < 2; ++i) ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, message), SendResult::kAccepted);
  EXPECT_EQ(team_.Post({1, "test"}, {2, "a"}, message), SendResult::kFull);
  EXPECT_EQ(team_.Post({2, "test"}, {1, "a"}, message), SendResult::kAccepted) << "each sender has its own rate";
  team_.AdvanceTime(milliseconds(1100));
  EXPECT_THAT(team_.TakeMessages({2, "a"}), SizeIs(1));
  team_.AdvanceTime(milliseconds(1100));
  EXPECT_THAT(team_.TakeMessages({2, "a"}), SizeIs(1));
}

TEST_F(SimulatedTeamTest, LossAndRepetitionOccurAtTheirRatios) {
  team_.radio().loss_ratio = 0.25;
  team_.radio().duplicate_ratio = 0.1;
  for (int i = 0; i < 4000; ++i) ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_NEAR(static_cast<double>(team_.TakeMessages({2, "a"}).size()), 3000 * (1 + 0.1 / 30), 150);
  team_.AdvanceTime(seconds(30));
  EXPECT_NEAR(static_cast<double>(team_.TakeMessages({2, "a"}).size()), 300 * (1 - 1.0 / 30), 80);
}

TEST_F(SimulatedTeamTest, CopiesMayArriveMinutesLater) {
  team_.radio().duplicate_ratio = 1;
  team_.radio().duplicate_delay_max = seconds(600);
  ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, Numbered(1)), SendResult::kAccepted);
  team_.AdvanceTime(milliseconds(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({2, "a"})), ElementsAre(1));
  for (int i = 0; i < 200; ++i) ASSERT_EQ(team_.Post({1, "test"}, {2, "b"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(seconds(300));
  EXPECT_NEAR(static_cast<double>(team_.TakeMessages({2, "b"}).size()), 300, 30);
  team_.AdvanceTime(seconds(301));
  EXPECT_NEAR(static_cast<double>(team_.TakeMessages({2, "b"}).size()), 100, 30);
}

TEST_F(SimulatedTeamTest, JitterReordersMessages) {
  team_.radio().latency_jitter = seconds(1);
  for (int i = 0; i < 50; ++i) ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, Numbered(i)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(2));
  const std::vector<std::uint64_t> numbers = NumbersOf(team_.TakeMessages({2, "a"}));
  EXPECT_THAT(numbers, SizeIs(50));
  EXPECT_FALSE(std::is_sorted(numbers.begin(), numbers.end()));
}

TEST_F(SimulatedTeamTest, ACutLinkLosesMessagesInFlightAndNotifiesBothEnds) {
  std::vector<std::string> heard;
  for (AgentId agent : {1, 2}) {
    team_.Spawn(agent, "sync",
                Scripted([](Context& context) { context.WatchPeers(); },
                         [&](Context& context, const proto::Message& message) {
                           ASSERT_TRUE(message.has_peer_event());
                           heard.push_back(ToString(context.self()) +
                                           (message.peer_event().is_connected() ? "+" : "-") +
                                           std::to_string(message.peer_event().peer()));
                         }));
  }
  team_.RunUntilIdle();
  // At the start of a simulated team, all agents are connected.
  EXPECT_THAT(heard, ElementsAre("1/sync+2", "1/sync+3", "2/sync+1", "2/sync+3"));
  heard.clear();
  ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, {}), SendResult::kAccepted);
  team_.SetLink(1, 2, false);
  EXPECT_EQ(team_.Post({1, "test"}, {2, "a"}, {}), SendResult::kUnreachable);
  EXPECT_EQ(team_.Post({1, "test"}, {3, "a"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(team_.TakeMessages({2, "a"}), IsEmpty());
  EXPECT_THAT(team_.TakeMessages({3, "a"}), SizeIs(1));
  team_.SetLink(2, 1, true);
  EXPECT_EQ(team_.Post({1, "test"}, {2, "a"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(team_.TakeMessages({2, "a"}), SizeIs(1));
  EXPECT_THAT(heard, ElementsAre("1/sync-2", "2/sync-1", "2/sync+1", "1/sync+2"));
}

TEST_F(SimulatedTeamTest, AnUnreportedCutLosesMessagesSilently) {
  team_.SetLink(1, 2, false, /*tell=*/false);
  EXPECT_EQ(team_.Post({1, "test"}, {2, "a"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(team_.TakeMessages({2, "a"}), IsEmpty());
}

TEST_F(SimulatedTeamTest, TheFilterSeesAndDropsMessages) {
  team_.SetFilter([](AgentId from, AgentId to, const proto::Message& message) {
    EXPECT_EQ(from, 1u);
    EXPECT_EQ(to, 2u);
    return message.request_id() != 2;
  });
  for (int i = 1; i <= 3; ++i) ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, Numbered(i)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({2, "a"})), ElementsAre(1, 3));
}

TEST_F(SimulatedTeamTest, TimersFireInOrderOfTimeAndThenOfCreation) {
  std::vector<std::uint64_t> heard;
  std::vector<MonotonicTime> times;
  const MonotonicTime start = team_.now();
  team_.Spawn(1, "clock",
              Scripted(
                  [](Context& context) {
                    context.AfterTimer(seconds(2), 1, 20);
                    context.AfterTimer(seconds(1), 1, 10);
                    context.AfterTimer(seconds(1), 1, 11);
                    context.Cancel(context.AfterTimer(seconds(1), 1, 12));
                  },
                  [&](Context& context, const proto::Message& message) {
                    EXPECT_EQ(message.timer().kind(), 1u);
                    heard.push_back(message.timer().value());
                    times.push_back(context.now());
                  }));
  team_.AdvanceTime(milliseconds(999));
  EXPECT_THAT(heard, IsEmpty());
  team_.AdvanceTime(seconds(5));
  EXPECT_THAT(heard, ElementsAre(10, 11, 20));
  EXPECT_THAT(times, ElementsAre(start + seconds(1), start + seconds(1), start + seconds(2)));
}

TEST_F(SimulatedTeamTest, WallClockStartsIn2026AndMovesWithVirtualTime) {
  EXPECT_EQ(team_.utc_now_ns(), 1'767'225'600'000'000'000);
  team_.AdvanceTime(seconds(3));
  EXPECT_EQ(team_.utc_now_ns(), 1'767'225'603'000'000'000);
}

TEST_F(SimulatedTeamTest, FailedActorIsRestartedAndKeepsItsMailboxButNotItsTimers) {
  int made = 0;
  std::vector<std::uint64_t> heard;
  team_.Spawn(1, "fragile", [&] {
    ++made;
    return std::make_unique<ScriptedActor>(
        [&](Context& context) {
          if (made == 1) context.AfterTimer(seconds(1), 1, 100);
        },
        [&](Context& context, const proto::Message& message) {
          heard.push_back(message.request_id());
          if (message.request_id() == 1) context.Fail({ErrorCode::kInternal, "disk gone", {}});
          EXPECT_FALSE(message.has_timer());
        });
  });
  for (int i = 1; i <= 3; ++i) ASSERT_EQ(team_.Post({1, "test"}, {1, "fragile"}, Numbered(i)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(5));
  EXPECT_THAT(heard, ElementsAre(1, 2, 3));
  EXPECT_EQ(made, 2);
  EXPECT_EQ(team_.restarts(1), 1u);
}

TEST_F(SimulatedTeamTest, ExceptionsAreFailuresAndTheSecondRestartWaits) {
  std::vector<MonotonicTime> started;
  team_.Spawn(1, "fragile",
              Scripted([&](Context& context) { started.push_back(context.now()); },
                       [](Context&, const proto::Message&) { throw std::runtime_error("a library's"); }));
  const MonotonicTime start = team_.now();
  for (int i = 1; i <= 3; ++i) ASSERT_EQ(team_.Post({1, "test"}, {1, "fragile"}, Numbered(i)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(5));
  // The second and third restart are delayed by 100 and 200 ms, each with a jitter of up to 20 %.
  ASSERT_THAT(started, SizeIs(4));
  EXPECT_EQ(started[0], start);
  EXPECT_EQ(started[1], start);
  EXPECT_THAT(started[2] - start, AllOf(Ge(milliseconds(80)), Le(milliseconds(120)), Ne(milliseconds(100))));
  EXPECT_THAT(started[3] - started[2], AllOf(Ge(milliseconds(160)), Le(milliseconds(240))));
}

TEST_F(SimulatedTeamTest, AgentGivesUpItsRoleBeforeAnActorFailsPermanently) {
  std::vector<std::string> stepped_down;
  team_.Spawn(1, "role", OnEachMessage([&](Context&, const proto::Message& message) {
                stepped_down.push_back(message.step_down().actor());
              }));
  team_.Spawn(1, "hopeless", Scripted([](Context&) { throw std::runtime_error("never works"); }, nullptr));
  team_.AdvanceTime(seconds(20));
  EXPECT_THAT(stepped_down, ElementsAre("hopeless"));
  EXPECT_TRUE(team_.is_running(1));
  team_.AdvanceTime(seconds(60));
  EXPECT_FALSE(team_.is_running(1));
  EXPECT_THAT(stepped_down, SizeIs(1));
}

TEST_F(SimulatedTeamTest, CrashedActorIsRestartedAndMonitorsAreNotified) {
  int made = 0;
  std::vector<std::string> downs;
  team_.Spawn(1, "victim", Scripted([&](Context&) { ++made; }, nullptr));
  team_.Spawn(1, "watcher",
              Scripted(
                  [](Context& context) {
                    context.Monitor({1, "victim"});
                    context.Monitor({2, "sync"});
                  },
                  [&](Context&, const proto::Message& message) { downs.push_back(message.down().actor()); }));
  team_.CrashActor({1, "victim"});
  team_.RunUntilIdle();
  EXPECT_EQ(made, 2);
  EXPECT_THAT(downs, ElementsAre("victim"));
  team_.SetLink(1, 2, false);
  team_.RunUntilIdle();
  EXPECT_THAT(downs, ElementsAre("victim", "sync"));
}

TEST_F(SimulatedTeamTest, FaultsStrikeBeforeDuringAndAfterAHandler) {
  for (const auto& [fault, handled, sent] :
       {std::tuple(Fault::kNone, 1, 2u), std::tuple(Fault::kBeforeHandler, 0, 0u),
        std::tuple(Fault::kAtFirstSend, 1, 0u), std::tuple(Fault::kAfterFirstSend, 1, 1u),
        std::tuple(Fault::kAfterHandler, 1, 2u)}) {
    SimulatedTeam team(/*seed=*/1);
    team.AddAgent(1);
    int handlers = 0;
    team.Spawn(1, "victim", OnEachMessage([&](Context& context, const proto::Message&) {
                 ++handlers;
                 (void)context.Send({1, "probe"}, {});
                 (void)context.Send({1, "probe"}, {});
               }));
    team.SetFault([fault = fault](const Address& actor, const proto::Message& message) {
      EXPECT_EQ(actor, (Address{1, "victim"}));
      return message.request_id() == 5 ? fault : Fault::kNone;
    });
    ASSERT_EQ(team.Post({1, "test"}, {1, "victim"}, Numbered(5)), SendResult::kAccepted);
    team.RunUntilIdle();
    EXPECT_EQ(handlers, handled);
    EXPECT_THAT(team.TakeMessages({1, "probe"}), SizeIs(sent));
    EXPECT_EQ(team.restarts(1), fault == Fault::kNone ? 0u : 1u);
  }
}

TEST_F(SimulatedTeamTest, ExpectWaitsForABodyAndDropsEarlierMessages) {
  const Address probe{1, "probe"};
  proto::Message hello;
  hello.mutable_hello();
  ASSERT_EQ(team_.Post({2, "a"}, probe, Numbered(1)), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({2, "a"}, probe, hello), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({2, "a"}, probe, Numbered(3)), SendResult::kAccepted);
  const auto expected = team_.Expect(probe, proto::Message::kHello, seconds(1));
  ASSERT_TRUE(expected);
  EXPECT_EQ(expected->hop_sender(), 2u);
  EXPECT_FALSE(team_.Expect(probe, proto::Message::kHello, seconds(1)));
  EXPECT_THAT(NumbersOf(team_.TakeMessages(probe)), ElementsAre(3));
}

TEST_F(SimulatedTeamTest, TakeSentShowsWhatAnActorSentToOthers) {
  team_.RecordSent({1, "relay"});
  team_.Spawn(2, "sync", OnEachMessage(nullptr));
  EXPECT_EQ(RelayOnce({2, "sync"}), SendResult::kAccepted);
  const std::vector<proto::Message> sent = team_.TakeSent({1, "relay"});
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_EQ(sent[0].destination_id(), 2u);
  EXPECT_EQ(sent[0].destination_actor(), "sync");
  EXPECT_THAT(team_.TakeSent({1, "relay"}), IsEmpty());
}

TEST_F(SimulatedTeamTest, PartitionCutsBetweenGroupsUntilHealed) {
  const auto reach = [this](AgentId from, AgentId to) {
    return team_.Post({from, "test"}, {to, "a"}, {}) == SendResult::kAccepted;
  };
  team_.Partition({{1, 3}});
  EXPECT_TRUE(reach(1, 3));
  EXPECT_FALSE(reach(1, 2));
  EXPECT_FALSE(reach(2, 3));
  team_.Partition({{1}, {2, 3}});
  EXPECT_FALSE(reach(1, 3));
  EXPECT_TRUE(reach(2, 3));
  team_.Heal();
  EXPECT_TRUE(reach(1, 2));
  EXPECT_TRUE(reach(1, 3));
}

TEST_F(SimulatedTeamTest, ActorNamesAreSentOnlyBetweenAgents) {
  std::string source = "unset";
  Address sender;
  team_.Spawn(1, "ear", OnEachMessage([&](Context& context, const proto::Message& message) {
                source = message.source_actor();
                sender = context.sender();
              }));
  ASSERT_EQ(team_.Post({1, "test"}, {1, "ear"}, {}), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_EQ(source, "");
  EXPECT_EQ(sender, (Address{1, "test"}));
  ASSERT_EQ(team_.Post({2, "test"}, {1, "ear"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(source, "test");
  EXPECT_EQ(sender, (Address{2, "test"}));
}

TEST_F(SimulatedTeamTest, TraceAndDeadLettersAreKept) {
  proto::TraceReply reply;
  team_.Spawn(1, "a", OnEachMessage([&](Context& context, const proto::Message& message) {
                if (message.request_id() == 7) throw std::runtime_error("seven");
                reply = context.GetTrace({});
              }));
  ASSERT_EQ(team_.Post({2, "test"}, {1, "a"}, Numbered(7)), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({2, "test"}, {1, "a"}, Numbered(8)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  ASSERT_THAT(reply.dead_letters(), SizeIs(1));
  EXPECT_EQ(reply.dead_letters(0).error().text(), "seven");
  EXPECT_EQ(reply.dead_letters(0).from_agent(), 2u);
  ASSERT_THAT(reply.events(), SizeIs(1));
  EXPECT_EQ(reply.events(0).kind(), proto::TRACE_FAILED);
  EXPECT_THAT(team_.GetTrace(1).dead_letters(), SizeIs(1));
}

TEST_F(SimulatedTeamTest, APermanentlyFailedActorCrashesItsAgent) {
  team_.Spawn(1, "hopeless", Scripted([](Context&) { throw std::runtime_error("never works"); }, nullptr));
  team_.Spawn(2, "healthy", OnEachMessage(nullptr));
  team_.AdvanceTime(seconds(60));
  EXPECT_FALSE(team_.is_running(1));
  EXPECT_TRUE(team_.is_running(2));
  EXPECT_EQ(team_.restarts(1), 5u);
}

TEST_F(SimulatedTeamTest, ACrashDropsEverythingAndARestartSpawnsActorsInOrder) {
  std::vector<std::string> log;
  for (const char* name : {"storage", "sync"}) {
    team_.Spawn(1, name,
                Scripted(
                    [&, name](Context& context) {
                      log.push_back(std::string("start ") + name);
                      context.AfterTimer(seconds(10), 1);
                    },
                    [&, name](Context&, const proto::Message& message) {
                      log.push_back(std::string(message.has_timer() ? "timer " : "message ") + name);
                    }));
  }
  ASSERT_EQ(team_.Post({1, "test"}, {1, "sync"}, {}), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({2, "test"}, {1, "sync"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(Duration::zero());
  EXPECT_THAT(log, ElementsAre("start storage", "start sync", "message sync"));
  log.clear();
  ASSERT_EQ(team_.Post({1, "test"}, {1, "storage"}, {}), SendResult::kAccepted);
  team_.Crash(1);
  EXPECT_FALSE(team_.is_running(1));
  EXPECT_EQ(team_.Post({1, "test"}, {1, "storage"}, {}), SendResult::kUnreachable);
  EXPECT_EQ(team_.Post({2, "test"}, {1, "storage"}, {}), SendResult::kAccepted) << "nobody knows";
  team_.AdvanceTime(seconds(5));
  team_.Restart(1);
  team_.AdvanceTime(seconds(9));
  EXPECT_THAT(log, ElementsAre("start storage", "start sync"));
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(log, ElementsAre("start storage", "start sync", "timer storage", "timer sync"));
}

TEST_F(SimulatedTeamTest, AWaitingTimerIsDroppedWhenTheActorFails) {
  std::vector<std::uint64_t> heard;
  team_.Spawn(1, "fragile", OnEachMessage([&](Context& context, const proto::Message& message) {
                if (message.has_timer()) {
                  heard.push_back(message.timer().value());
                } else if (message.request_id() == 1) {
                  context.AfterTimer(Duration::zero(), 1, 1);
                  context.Fail({ErrorCode::kInternal, "on purpose", {}});
                } else {
                  context.AfterTimer(Duration::zero(), 1, 2);
                }
              }));
  for (int i = 1; i <= 2; ++i) ASSERT_EQ(team_.Post({1, "test"}, {1, "fragile"}, Numbered(i)), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_THAT(heard, ElementsAre(2));
}

TEST_F(SimulatedTeamTest, RestartedAgentKnowsOnlyItsConfiguredRoles) {
  team_.SetRoles(1, Roles(2, 3));
  team_.Spawn(1, "role", OnEachMessage([](Context& context, const proto::Message&) { context.SetRoles(Roles(3, 2)); }));
  ASSERT_EQ(team_.Post({1, "test"}, {1, "role"}, {}), SendResult::kAccepted);
  team_.RunUntilIdle();
  ASSERT_EQ(team_.Post({1, "test"}, {kLeaderAlias, "a"}, Numbered(1)), SendResult::kAccepted);
  team_.Crash(1);
  team_.Restart(1);
  ASSERT_EQ(team_.Post({1, "test"}, {kLeaderAlias, "a"}, Numbered(2)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({3, "a"})), ElementsAre(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({2, "a"})), ElementsAre(2));
}

TEST_F(SimulatedTeamTest, MessagesInFlightToACrashedAgentAreLostEvenIfItReturnsInTime) {
  team_.radio().latency = seconds(10);
  ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, Numbered(1)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(5));
  team_.Crash(2);
  team_.Restart(2);
  ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, Numbered(2)), SendResult::kAccepted);
  team_.AdvanceTime(seconds(20));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({2, "a"})), ElementsAre(2));
}

TEST_F(SimulatedTeamTest, ACrashLosesTheSendersOutboxButNotSentMessages) {
  team_.radio().bytes_per_second = 1000;
  for (int i = 1; i <= 3; ++i) {
    proto::Message message = Numbered(i);
    message.set_sql(std::string(1000, 'x'));
    ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, message), SendResult::kAccepted);
  }
  team_.AdvanceTime(milliseconds(1500));
  team_.Crash(1);
  team_.Restart(1);
  ASSERT_EQ(team_.Post({1, "test"}, {2, "a"}, Numbered(4)), SendResult::kAccepted);
  team_.AdvanceTime(milliseconds(100));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({2, "a"})), ElementsAre(1, 4));
  team_.AdvanceTime(seconds(10));
  EXPECT_THAT(team_.TakeMessages({2, "a"}), IsEmpty());
}

TEST_F(SimulatedTeamTest, AMessageLargerThanTheOutboxFitsIntoAnEmptyOne) {
  team_.radio().bytes_per_second = 1000;
  team_.radio().outbox_bytes_max = 10;
  proto::Message message;
  message.set_sql(std::string(1000, 'x'));
  EXPECT_EQ(team_.Post({1, "test"}, {2, "a"}, message), SendResult::kAccepted);
  EXPECT_EQ(team_.Post({1, "test"}, {2, "a"}, message), SendResult::kFull);
}

TEST_F(SimulatedTeamTest, AHandlerCannotSendAfterItsAgentCrashed) {
  team_.Spawn(1, "sync", OnEachMessage([&](Context& context, const proto::Message&) {
                EXPECT_EQ(context.Send({2, "a"}, Numbered(1)), SendResult::kAccepted);
                EXPECT_EQ(context.Send({2, "a"}, Numbered(2)), SendResult::kUnreachable);
              }));
  team_.SetFilter([&](AgentId, AgentId, const proto::Message&) {
    team_.Crash(1);
    return true;
  });
  ASSERT_EQ(team_.Post({1, "test"}, {1, "sync"}, {}), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_FALSE(team_.is_running(1));
  EXPECT_THAT(NumbersOf(team_.TakeMessages({2, "a"})), ElementsAre(1));
}

TEST_F(SimulatedTeamTest, RequestStopEndsTheAgentAfterTheHandler) {
  team_.Spawn(1, "gateway", OnEachMessage([](Context& context, const proto::Message&) {
                context.RequestStop();
                EXPECT_EQ(context.Reply({}), SendResult::kAccepted);
              }));
  ASSERT_EQ(team_.Post({kClients, "c"}, {1, "gateway"}, Numbered(1)), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_FALSE(team_.is_running(1));
  EXPECT_THAT(team_.TakeMessages({kClients, "c"}), SizeIs(1));
}

TEST_F(SimulatedTeamTest, FullMailboxRefusesAndCounts) {
  SystemStatus status;
  team_.Spawn(1, "small",
              OnEachMessage([&](Context& context, const proto::Message&) { status = context.GetSystemStatus(); }),
              {.messages_max = 2});
  EXPECT_EQ(team_.Post({1, "test"}, {1, "small"}, {}), SendResult::kAccepted);
  EXPECT_EQ(team_.Post({1, "test"}, {1, "small"}, {}), SendResult::kAccepted);
  EXPECT_EQ(team_.Post({1, "test"}, {1, "small"}, {}), SendResult::kFull);
  team_.RunUntilIdle();
  ASSERT_THAT(status.actors, SizeIs(1));
  EXPECT_EQ(status.actors[0].handled(), 2);
  EXPECT_EQ(status.actors[0].dropped(), 1);
  EXPECT_EQ(status.actors[0].queued_max(), 2);
  EXPECT_THAT(status.peers, SizeIs(2));
  EXPECT_EQ(team_.GetSystemStatus(1).actors.at(0).dropped(), 1);
}

TEST_F(SimulatedTeamTest, RunUntilStopsAtTheConditionOrTheLimit) {
  int ticks = 0;
  team_.Spawn(1, "clock",
              Scripted([](Context& context) { context.AfterTimer(seconds(1), 1); },
                       [&](Context& context, const proto::Message&) {
                         ++ticks;
                         context.AfterTimer(seconds(1), 1);
                       }));
  const MonotonicTime start = team_.now();
  EXPECT_TRUE(team_.RunUntil([&] { return ticks == 3; }, seconds(10)));
  EXPECT_EQ(team_.now(), start + seconds(3));
  EXPECT_FALSE(team_.RunUntil([&] { return ticks == 100; }, seconds(10)));
  EXPECT_EQ(team_.now(), start + seconds(13));
  EXPECT_EQ(ticks, 13);
  team_.Crash(1);
  EXPECT_FALSE(team_.RunUntil([] { return false; }, seconds(10)));
}

TEST_F(SimulatedTeamTest, AnEndlessLoopOfMessagesFailsACheck) {
  team_.Spawn(1, "loop",
              OnEachMessage([](Context& context, const proto::Message&) { (void)context.Send(context.self(), {}); }));
  ASSERT_EQ(team_.Post({1, "test"}, {1, "loop"}, {}), SendResult::kAccepted);
  EXPECT_DEATH(team_.RunUntilIdle(), "become idle");
}

// Runs a random walk of messages over a lossy radio. Returns a hash of the run.
std::uint64_t HashOfRun(std::uint64_t seed) {
  SimulatedTeam team(seed);
  for (AgentId agent : {1, 2, 3}) team.AddAgent(agent);
  team.radio().loss_ratio = 0.01;
  team.radio().duplicate_ratio = 0.02;
  team.radio().latency_jitter = milliseconds(50);
  for (AgentId agent : {1, 2, 3}) {
    team.Spawn(agent, "walker", OnEachMessage([](Context& context, const proto::Message& message) {
                 if (message.request_id() == 200) throw std::runtime_error("tired");
                 const AgentId next = 1 + static_cast<AgentId>(context.rng()() % 3);
                 (void)context.Send({next, "walker"}, Numbered(message.request_id() + 1));
               }));
  }
  for (int i = 0; i < 10; ++i) (void)team.Post({1, "test"}, {1, "walker"}, Numbered(1));
  team.AdvanceTime(seconds(20));
  team.Crash(2);
  team.AdvanceTime(seconds(20));
  team.Restart(2);
  (void)team.Post({1, "test"}, {1, "walker"}, Numbered(1));
  team.AdvanceTime(seconds(60));
  return team.trace_hash();
}

TEST(SimulatedTeamSeedTest, OneSeedReplaysOneRun) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    EXPECT_EQ(HashOfRun(seed), HashOfRun(seed));
  }
  EXPECT_NE(HashOfRun(1), HashOfRun(2));
}

}  // namespace
}  // namespace moondb::simulation
