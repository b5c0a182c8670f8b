#include "runtime/actor_system.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <future>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "runtime/system_status.h"
#include "tests/runtime/scripted_actor.h"

namespace moondb {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ContainsRegex;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr seconds kPatience(60);  // Longest wait for an event. Only a broken runtime needs that long.

// Passes values from handlers to the test, in order. Thread-safe.
template <typename T>
class Heard {
 public:
  void Add(T value) {
    {
      const std::lock_guard lock(mutex_);
      values_.push_back(std::move(value));
    }
    changed_.notify_all();
  }
  // Waits for the next value and returns it. The test fails if none arrives within kPatience.
  T Next() {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, kPatience, [this] { return !values_.empty(); })) {
      ADD_FAILURE() << "nothing was heard";
      return {};
    }
    T value = std::move(values_.front());
    values_.pop_front();
    return value;
  }
  std::vector<T> Next(int count) {
    std::vector<T> values;
    for (int i = 0; i < count; ++i) values.push_back(Next());
    return values;
  }
  bool empty() {
    const std::lock_guard lock(mutex_);
    return values_.empty();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<T> values_;
};

// Pass waits until another thread calls Open. Open may be called only once.
class Gate {
 public:
  void Open() { promise_.set_value(); }
  void Pass() { EXPECT_EQ(future_.wait_for(kPatience), std::future_status::ready); }

 private:
  std::promise<void> promise_;
  std::shared_future<void> future_ = promise_.get_future().share();
};

class FakeTransport final : public Transport {
 public:
  SendResult Send(const Address& to, const proto::Message& message) override {
    sent.Add({to, message});
    return SendResult::kAccepted;
  }
  std::vector<proto::PeerStatus> Peers() const override {
    proto::PeerStatus peer;
    peer.set_agent_id(2);
    return {peer};
  }

  Heard<std::pair<Address, proto::Message>> sent;
};

class ActorSystemTest : public testing::Test {
 protected:
  static ActorSystem::Options DefaultOptions() {
    ActorSystem::Options options;
    options.self = 1;
    options.base_station = 3;
    options.seed = 1;
    return options;
  }

  FakeTransport transport_;
  Heard<std::string> heard_;
  ActorSystem system_{DefaultOptions()};
};

TEST_F(ActorSystemTest, MessagesOfOneSenderAreHandledInOrder) {
  Heard<std::uint64_t> numbers;
  system_.Spawn("a", {}, OnEachMessage([&](Context&, const proto::Message& m) { numbers.Add(m.request_id()); }));
  system_.Start(nullptr);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(system_.Post("a", Numbered(i)), SendResult::kAccepted);
  for (std::uint64_t i = 0; i < 1000; ++i) ASSERT_EQ(numbers.Next(), i);
  system_.Stop();
}

TEST_F(ActorSystemTest, ActorsReplyToEachOther) {
  system_.Spawn("ping", {}, OnEachMessage([&](Context& context, const proto::Message& message) {
                  if (context.sender().actor == "outside") {
                    EXPECT_EQ(context.sender(), (Address{1, "outside"}));
                    EXPECT_EQ(context.Send({1, "pong"}, Numbered(42)), SendResult::kAccepted);
                  } else {
                    heard_.Add(ToString(context.sender()) + " " + std::to_string(message.request_id()) + " of " +
                               std::to_string(message.agent_id()));
                  }
                }));
  system_.Spawn("pong", {.placement = Placement::kOwnThread},
                OnEachMessage([](Context& context, const proto::Message&) {
                  EXPECT_EQ(context.sender(), (Address{1, "ping"}));
                  EXPECT_EQ(context.Reply({}), SendResult::kAccepted);
                }));
  system_.Start(nullptr);
  ASSERT_EQ(system_.Post("ping", {}), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "1/pong 42 of 1");
  system_.Stop();
}

TEST_F(ActorSystemTest, AnActorRunsOnOneThreadAtATime) {
  // The counter has no lock. Two threads at a time would lose counts, and thread sanitizer would report the race.
  int handled = 0;
  std::promise<void> done;
  system_.Spawn("counter", {.messages_max = 100'000}, OnEachMessage([&](Context&, const proto::Message&) {
                  if (++handled == 4000) done.set_value();
                }));
  for (const char* name : {"a", "b", "c", "d"}) {
    system_.Spawn(name, {}, OnEachMessage([](Context& context, const proto::Message&) {
                    EXPECT_EQ(context.Send({1, "counter"}, {}), SendResult::kAccepted);
                  }));
  }
  system_.Start(nullptr);
  for (int i = 0; i < 1000; ++i) {
    for (const char* name : {"a", "b", "c", "d"}) ASSERT_EQ(system_.Post(name, {}), SendResult::kAccepted);
  }
  EXPECT_EQ(done.get_future().wait_for(kPatience), std::future_status::ready);
  system_.Stop();
}

TEST_F(ActorSystemTest, BusyActorsLetOthersRun) {
  ActorSystem::Options options = DefaultOptions();
  options.worker_count = 1;
  ActorSystem system(options);
  std::promise<void> heard;
  system.Spawn("greedy", {},
               Scripted([](Context& context) { (void)context.Send(context.self(), {}); },
                        [](Context& context, const proto::Message&) {
                          (void)context.Send(context.self(), {});  // The actor always has a message to handle.
                        }));
  system.Spawn("modest", {}, OnEachMessage([&](Context&, const proto::Message&) { heard.set_value(); }));
  system.Start(nullptr);
  ASSERT_EQ(system.Post("modest", {}), SendResult::kAccepted);
  EXPECT_EQ(heard.get_future().wait_for(kPatience), std::future_status::ready);
  system.Stop();
}

TEST_F(ActorSystemTest, ActorsStartInOrderBeforeMessagesFlow) {
  for (const std::string name : {"a", "b", "c"}) {
    const Placement placement = name == "b" ? Placement::kOwnThread : Placement::kPool;
    system_.Spawn(name, {.placement = placement},
                  Scripted(
                      [this, name](Context& context) {
                        heard_.Add("start " + name);
                        EXPECT_EQ(context.Send({1, "a"}, {}), SendResult::kAccepted);
                      },
                      [this](Context&, const proto::Message&) { heard_.Add("message"); }));
  }
  ASSERT_EQ(system_.Post("a", {}), SendResult::kAccepted) << "waits for Start";
  system_.Start(nullptr);
  EXPECT_THAT(heard_.Next(7), ElementsAre("start a", "start b", "start c", "message", "message", "message", "message"));
  system_.Stop();
}

// An actor that reports the thread of its constructor, its handlers and its destructor.
class ThreadBoundActor final : public Actor {
 public:
  explicit ThreadBoundActor(Heard<std::thread::id>* threads) : threads_(threads) {
    threads_->Add(std::this_thread::get_id());
  }
  ~ThreadBoundActor() override { threads_->Add(std::this_thread::get_id()); }
  void OnStart(Context&) override { threads_->Add(std::this_thread::get_id()); }
  void OnMessage(Context& context, const proto::Message& message) override {
    threads_->Add(std::this_thread::get_id());
    if (message.request_id() == 1) context.Fail({ErrorCode::kUnavailable, "driver lost", {}});
  }

 private:
  Heard<std::thread::id>* threads_;
};

TEST_F(ActorSystemTest, OwnThreadActorIsConstructedRunAndDestroyedOnOneThread) {
  Heard<std::thread::id> threads;
  system_.Spawn("gl", {.placement = Placement::kOwnThread},
                [&] { return std::make_unique<ThreadBoundActor>(&threads); });
  system_.Start(nullptr);
  ASSERT_EQ(system_.Post("gl", Numbered(1)), SendResult::kAccepted);
  ASSERT_EQ(system_.Post("gl", Numbered(2)), SendResult::kAccepted);
  // The first actor reports its thread four times: in its constructor, in OnStart, at the failing message and in its
  // destructor. The second actor reports its thread in its constructor, in OnStart and at message 2.
  std::vector<std::thread::id> ids = threads.Next(7);
  system_.Stop();
  ids.push_back(threads.Next());
  for (const std::thread::id id : ids) EXPECT_EQ(id, ids[0]);
  EXPECT_NE(ids[0], std::this_thread::get_id());
  EXPECT_TRUE(threads.empty());
}

TEST_F(ActorSystemTest, FullMailboxRefusesAndCounts) {
  Gate gate;
  Heard<SystemStatus> statuses;
  system_.Spawn("slow", {.messages_max = 2}, OnEachMessage([&](Context& context, const proto::Message& message) {
                  if (message.request_id() == 1) {
                    heard_.Add("in hand");
                    gate.Pass();
                  } else {
                    statuses.Add(context.GetSystemStatus());
                  }
                }));
  system_.Start(&transport_);
  ASSERT_EQ(system_.Post("slow", Numbered(1)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "in hand");
  EXPECT_EQ(system_.Post("slow", Numbered(2)), SendResult::kAccepted);
  EXPECT_EQ(system_.Post("slow", Numbered(3)), SendResult::kAccepted);
  EXPECT_EQ(system_.Post("slow", Numbered(4)), SendResult::kFull);
  gate.Open();
  statuses.Next();
  const SystemStatus status = statuses.Next();
  ASSERT_THAT(status.actors, SizeIs(1));
  EXPECT_EQ(status.actors[0].name(), "slow");
  EXPECT_EQ(status.actors[0].handled(), 3);
  EXPECT_EQ(status.actors[0].queued(), 0);
  EXPECT_EQ(status.actors[0].queued_max(), 2);
  EXPECT_EQ(status.actors[0].dropped(), 1);
  ASSERT_THAT(status.peers, SizeIs(1));
  EXPECT_EQ(status.peers[0].agent_id(), 2u);
  EXPECT_GE(status.uptime, Duration::zero());
  system_.Stop();
}

TEST_F(ActorSystemTest, FailedActorIsRestartedAndKeepsItsMailbox) {
  Gate gate;
  std::atomic<int> made = 0;
  system_.Spawn("fragile", {}, [&] {
    ++made;
    return std::make_unique<ScriptedActor>(
        [&](Context& context) {
          heard_.Add("start");
          if (made == 1) context.After({}, Numbered(100));
        },
        [&](Context&, const proto::Message& message) {
          if (message.request_id() == 1) {
            gate.Pass();
            throw std::runtime_error("a library's");
          }
          heard_.Add("message " + std::to_string(message.request_id()));
        });
  });
  system_.Start(nullptr);
  for (int i = 1; i <= 3; ++i) ASSERT_EQ(system_.Post("fragile", Numbered(i)), SendResult::kAccepted);
  gate.Open();
  // The timer may fire before the failure. Otherwise the failure drops the timer.
  std::vector<std::string> log;
  while (log.empty() || log.back() != "message 3") {
    const std::string line = heard_.Next();
    ASSERT_FALSE(line.empty());
    if (line != "message 100") log.push_back(line);
  }
  EXPECT_THAT(log, ElementsAre("start", "start", "message 2", "message 3"));
  EXPECT_EQ(made, 2);
  system_.Stop();
}

TEST_F(ActorSystemTest, TimersOfADeadIncarnationAreDropped) {
  Gate gate;
  std::atomic<int> made = 0;
  system_.Spawn("fragile", {.placement = Placement::kOwnThread}, [&] {
    ++made;
    return std::make_unique<ScriptedActor>(nullptr, [&](Context& context, const proto::Message& message) {
      if (message.has_timer()) {
        heard_.Add("timer " + std::to_string(message.timer().value()));
      } else if (message.request_id() == 1) {
        context.AfterTimer(Duration::zero(), 1, /*value=*/1);
        context.AfterTimer(hours(1), 1, /*value=*/2);
        // Waits until the first timer is in the mailbox.
        while (context.GetSystemStatus().actors[0].queued() < 1) std::this_thread::yield();
        context.Fail({ErrorCode::kInternal, "on purpose", {}});
      } else {
        context.AfterTimer(Duration::zero(), 1, /*value=*/3);
      }
    });
  });
  system_.Start(nullptr);
  ASSERT_EQ(system_.Post("fragile", Numbered(1)), SendResult::kAccepted);
  ASSERT_EQ(system_.Post("fragile", Numbered(2)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "timer 3");
  EXPECT_EQ(made, 2);
  system_.Stop();
}

TEST_F(ActorSystemTest, APermanentlyFailedActorIsReportedOnce) {
  ActorSystem::Options options = DefaultOptions();
  options.restarts_max = 1;
  options.on_fatal = [this](const Error& error) { heard_.Add(error.text); };
  ActorSystem system(options);
  for (const char* name : {"a", "b"}) {
    system.Spawn(name, {}, Scripted([](Context&) { throw std::runtime_error("never works"); }, nullptr));
  }
  system.Start(nullptr);  // Start returns although the actors fail.
  // Restart delays are jittered, so either actor may be the first to fail permanently.
  EXPECT_THAT(heard_.Next(), ContainsRegex("1/(a|b) has failed permanently: never works"));
  EXPECT_EQ(system.Post("a", {}), SendResult::kUnreachable);
  EXPECT_EQ(system.Post("b", {}), SendResult::kUnreachable);
  system.Stop();
  EXPECT_TRUE(heard_.empty());
}

TEST_F(ActorSystemTest, StartThatFailsLessThanOncePerPeriodIsRetriedAtOnce) {
  ActorSystem::Options options = DefaultOptions();
  options.restart_period = milliseconds(1);
  ActorSystem system(options);
  int made = 0;
  system.Spawn("late", {},
               Scripted(
                   [&](Context& context) {
                     const MonotonicTime end = context.now() + milliseconds(2);
                     while (context.now() < end) std::this_thread::yield();
                     if (++made < 4) throw std::runtime_error("not yet");
                   },
                   nullptr));
  system.Start(nullptr);  // Start returns although the actor fails three times.
  EXPECT_EQ(made, 4);
  system.Stop();
}

TEST_F(ActorSystemTest, SecondRestartIsDelayed) {
  std::atomic<int> made = 0;
  std::vector<MonotonicTime> started;  // Start times of the actor's incarnations.
  system_.Spawn("fragile", {}, [&] {
    ++made;
    return std::make_unique<ScriptedActor>(
        [&](Context& context) {
          started.push_back(context.now());
          if (made < 3) throw std::runtime_error("not yet");
          heard_.Add("started");
        },
        nullptr);
  });
  system_.Start(nullptr);
  EXPECT_EQ(heard_.Next(), "started");
  ASSERT_THAT(started, SizeIs(3));
  EXPECT_GE(started[2] - started[1], milliseconds(80));  // Jitter shortens 100 ms by at most 20 ms.
  system_.Stop();
}

TEST_F(ActorSystemTest, TimersFireInOrderUnlessCancelled) {
  system_.Spawn("clock", {.messages_max = 1},
                Scripted(
                    [](Context& context) {
                      context.AfterTimer(hours(1), 1, 9);
                      context.AfterTimer(milliseconds(3), 1, 3);
                      const TimerId cancelled = context.AfterTimer(milliseconds(2), 1, 2);
                      context.AfterTimer(milliseconds(1), 1, 1);
                      context.Cancel(cancelled);
                    },
                    [&](Context& context, const proto::Message& message) {
                      EXPECT_EQ(context.sender(), context.self());
                      heard_.Add(std::to_string(message.timer().value()));
                    }));
  system_.Start(nullptr);
  EXPECT_THAT(heard_.Next(2), ElementsAre("1", "3"));
  system_.Stop();
}

TEST_F(ActorSystemTest, OtherAgentsAreReachedThroughTheTransport) {
  system_.Spawn("a", {}, OnEachMessage([](Context& context, const proto::Message&) {
                  proto::RoleAssignment roles;
                  roles.set_leader(2);
                  roles.set_survivor(1);
                  context.SetRoles(roles);
                  EXPECT_EQ(context.Send({kLeaderAlias, "sync"}, Numbered(1)), SendResult::kAccepted);
                  EXPECT_EQ(context.Send({kBaseAlias, "sync"}, Numbered(2)), SendResult::kAccepted);
                  EXPECT_EQ(context.Send({kClients, "c1"}, Numbered(3)), SendResult::kAccepted);
                  EXPECT_EQ(context.Send({kSurvivorAlias, "nobody"}, {}), SendResult::kNoActor) << "that is itself";
                }));
  system_.Start(&transport_);
  ASSERT_EQ(system_.Post("a", {}), SendResult::kAccepted);
  const auto [leader, to_leader] = transport_.sent.Next();
  EXPECT_EQ(leader, (Address{2, "sync"}));
  EXPECT_EQ(to_leader.destination_id(), 2u);
  EXPECT_EQ(to_leader.destination_actor(), "sync");
  EXPECT_EQ(to_leader.hop_sender(), 1u);
  EXPECT_EQ(to_leader.source_actor(), "a");
  EXPECT_EQ(to_leader.agent_id(), 1u);
  EXPECT_EQ(transport_.sent.Next().first, (Address{3, "sync"}));
  EXPECT_EQ(transport_.sent.Next().first, (Address{kClients, "c1"}));
  system_.Stop();
}

TEST_F(ActorSystemTest, SendingToAnUnsetAliasFailsWithNoPeer) {
  std::promise<void> done;
  system_.Spawn("a", {}, OnEachMessage([&](Context& context, const proto::Message&) {
                  EXPECT_EQ(context.Send({kLeaderAlias, "sync"}, {}), SendResult::kNoPeer);
                  EXPECT_EQ(context.Send({2, "sync"}, {}), SendResult::kNoPeer) << "no transport";
                  EXPECT_EQ(context.Send({kClients, "c"}, {}), SendResult::kUnreachable);
                  EXPECT_EQ(context.Send({1, "b"}, {}), SendResult::kNoActor);
                  done.set_value();
                }));
  system_.Start(nullptr);
  ASSERT_EQ(system_.Post("a", {}), SendResult::kAccepted);
  EXPECT_EQ(done.get_future().wait_for(kPatience), std::future_status::ready);
  system_.Stop();
}

TEST_F(ActorSystemTest, MessagesFromPeersNameTheirSender) {
  system_.Spawn("sync", {}, OnEachMessage([&](Context& context, const proto::Message&) {
                  heard_.Add(ToString(context.sender()));
                  EXPECT_EQ(context.Reply({}), SendResult::kAccepted);
                }));
  system_.Start(&transport_);
  for (const AgentId from : {2u, 3u, 2u}) {
    OwnedMessage message;
    message->set_hop_sender(from);
    message->set_source_actor("other");
    message->set_destination_actor("sync");
    EXPECT_EQ(system_.Deliver(std::move(message)), SendResult::kAccepted);
    EXPECT_EQ(heard_.Next(), std::to_string(from) + "/other");
    EXPECT_EQ(transport_.sent.Next().first, (Address{from, "other"}));
  }
  system_.Stop();
}

TEST_F(ActorSystemTest, RepliesReturnToTheClientOrPeerThatAsked) {
  system_.Spawn("gateway", {}, OnEachMessage([](Context& context, const proto::Message&) {
                  EXPECT_EQ(context.Reply({}), SendResult::kAccepted);
                }));
  system_.Start(&transport_);
  OwnedMessage message = Numbered(8);
  message->set_hop_sender(kClients);
  message->set_source_actor("c7");
  message->set_destination_actor("gateway");
  EXPECT_EQ(system_.Deliver(std::move(message)), SendResult::kAccepted);
  const auto [to, reply] = transport_.sent.Next();
  EXPECT_EQ(to, (Address{kClients, "c7"}));
  EXPECT_EQ(reply.request_id(), 8u);
  OwnedMessage lost;
  lost->set_destination_actor("nobody");
  EXPECT_EQ(system_.Deliver(std::move(lost)), SendResult::kNoActor);
  system_.Stop();
}

TEST_F(ActorSystemTest, WatchersAreNotifiedOfPeerChanges) {
  system_.OnPeerChanged(3, true);  // No actor watches peers yet.
  system_.OnPeerChanged(4, true);
  system_.OnPeerChanged(4, false);
  for (const std::string name : {"role", "replica", "merge"}) {
    system_.Spawn(name, {.messages_max = 1},
                  Scripted(
                      [name](Context& context) {
                        if (name != "merge") context.WatchPeers();
                      },
                      [&, name](Context&, const proto::Message& message) {
                        heard_.Add(name + (message.peer_event().is_connected() ? "+" : "-") +
                                   std::to_string(message.peer_event().peer()));
                      }));
  }
  system_.Start(nullptr);
  EXPECT_THAT(heard_.Next(2), testing::UnorderedElementsAre("role+3", "replica+3"));
  system_.OnPeerChanged(2, true);
  EXPECT_THAT(heard_.Next(2), testing::UnorderedElementsAre("role+2", "replica+2"));
  system_.OnPeerChanged(2, true);  // Agent 2 is already connected, so this call notifies no actor.
  system_.OnPeerChanged(2, false);
  EXPECT_THAT(heard_.Next(2), testing::UnorderedElementsAre("role-2", "replica-2"));
  system_.Stop();
  EXPECT_TRUE(heard_.empty());
}

TEST_F(ActorSystemTest, RestartedActorIsNotifiedAgainOfPeersItWatches) {
  system_.Spawn("a", {},
                Scripted([](Context& context) { context.WatchPeers(); },
                         [&](Context& context, const proto::Message& message) {
                           if (!message.has_peer_event()) return context.Fail({ErrorCode::kInternal, "", {}});
                           heard_.Add("+" + std::to_string(message.peer_event().peer()));
                         }));
  system_.Start(nullptr);
  system_.OnPeerChanged(2, true);
  EXPECT_EQ(heard_.Next(), "+2");
  ASSERT_EQ(system_.Post("a", {}), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "+2");
}

// Returns the published message and its publisher, as "roles 2 of 1/role".
std::string NewsText(Context& context, const proto::Message& message) {
  const std::string what = message.has_roles_changed()
                               ? "roles " + std::to_string(message.roles_changed().roles().leader())
                               : "stored " + std::to_string(message.records_stored().last_row_id());
  return what + " of " + ToString(context.sender());
}

TEST_F(ActorSystemTest, PublishedMessagesReachPresentAndLaterWatchers) {
  const auto listener = [this](Topic topic) {
    return Scripted(
        [this, topic](Context& context) {
          context.Watch(topic);
          heard_.Add(context.self().actor + " watches");
        },
        [this](Context& context, const proto::Message& message) {
          if (!IsOfTopic(message)) return context.Fail({ErrorCode::kInternal, "", {}});
          heard_.Add(context.self().actor + ": " + NewsText(context, message));
        });
  };
  system_.Spawn("early", {}, listener(Topic::kRoles));
  system_.Spawn(
      "role", {}, OnEachMessage([](Context& context, const proto::Message& message) {
        proto::Message roles;
        roles.mutable_roles_changed()->mutable_roles()->set_leader(static_cast<AgentId>(message.request_id()));
        context.Publish(std::move(roles));
      }));
  system_.Spawn("storage", {}, OnEachMessage([](Context& context, const proto::Message& message) {
                  proto::Message stored;
                  stored.mutable_records_stored()->set_last_row_id(message.request_id());
                  context.Publish(std::move(stored));
                }));
  system_.Spawn("reader", {}, listener(Topic::kStored));
  system_.Start(nullptr);
  EXPECT_THAT(heard_.Next(2), ElementsAre("early watches", "reader watches"));
  ASSERT_EQ(system_.Post("role", Numbered(2)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "early: roles 2 of 1/role");
  ASSERT_EQ(system_.Post("storage", Numbered(7)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "reader: stored 7 of 1/storage");
  ASSERT_EQ(system_.Post("early", {}), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "early watches");
  EXPECT_EQ(heard_.Next(), "early: roles 2 of 1/role") << "after its restart it receives the last publication";
  ASSERT_EQ(system_.Post("role", Numbered(3)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "early: roles 3 of 1/role");
  ASSERT_EQ(system_.Post("reader", {}), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "reader watches");
  ASSERT_EQ(system_.Post("storage", Numbered(8)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "reader: stored 8 of 1/storage") << "the one before does not come again";
  system_.Stop();
  EXPECT_TRUE(heard_.empty());
}

TEST_F(ActorSystemTest, MonitorsAreNotifiedOfDeaths) {
  system_.Spawn("victim", {}, OnEachMessage([](Context&, const proto::Message&) { throw std::runtime_error("ouch"); }));
  system_.Spawn("watcher", {},
                Scripted(
                    [](Context& context) {
                      context.Monitor({1, "victim"});
                      context.Monitor({1, "nobody"});
                      context.Monitor({2, ""});
                      context.Monitor({kBaseAlias, "sync"});
                      context.Monitor({5, ""});
                      context.Demonitor({5, ""});
                    },
                    [&](Context&, const proto::Message& message) {
                      const proto::Down& down = message.down();
                      heard_.Add(std::to_string(down.agent()) + "/" + down.actor() + ": " + down.reason() +
                                 (down.is_final() ? " permanently" : ""));
                    }));
  system_.OnPeerChanged(2, true);
  system_.OnPeerChanged(3, true);
  system_.OnPeerChanged(5, true);
  system_.Start(nullptr);
  EXPECT_EQ(heard_.Next(), "1/nobody: there is no such actor permanently");
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(system_.Post("victim", {}), SendResult::kAccepted);
    EXPECT_EQ(heard_.Next(), "1/victim: ouch");
  }
  system_.OnPeerChanged(3, false);
  EXPECT_EQ(heard_.Next(), "3/sync: the connection was lost");
  system_.OnPeerChanged(5, false);
  system_.OnPeerChanged(2, false);
  EXPECT_EQ(heard_.Next(), "2/: the connection was lost");
  system_.Stop();
}

TEST_F(ActorSystemTest, ControlOvertakesWaitingData) {
  Gate gate;
  Gate is_in_handler;
  system_.Spawn("busy", {},
                Scripted([](Context& context) { context.WatchPeers(); },
                         [&](Context&, const proto::Message& message) {
                           if (message.request_id() == 1) {
                             is_in_handler.Open();
                             gate.Pass();
                           }
                           heard_.Add(message.has_peer_event() ? "peer" : std::to_string(message.request_id()));
                         }));
  system_.Start(nullptr);
  ASSERT_EQ(system_.Post("busy", Numbered(1)), SendResult::kAccepted);
  is_in_handler.Pass();
  for (int i = 2; i <= 4; ++i) ASSERT_EQ(system_.Post("busy", Numbered(i)), SendResult::kAccepted);
  system_.OnPeerChanged(2, true);
  gate.Open();
  EXPECT_THAT(heard_.Next(5), ElementsAre("1", "peer", "2", "3", "4"));
}

TEST_F(ActorSystemTest, ControlOvertakesABatchBeingHandled) {
  Gate gate;
  Gate is_in_handler;
  Gate all_posted;
  system_.Spawn("busy", {},
                Scripted([](Context& context) { context.WatchPeers(); },
                         [&](Context&, const proto::Message& message) {
                           if (message.request_id() == 1) all_posted.Pass();
                           if (message.request_id() == 2) {  // The actor takes messages 2, 3 and 4 in one batch.
                             is_in_handler.Open();
                             gate.Pass();
                           }
                           heard_.Add(message.has_peer_event() ? "peer" : std::to_string(message.request_id()));
                         }));
  system_.Start(nullptr);
  for (int i = 1; i <= 4; ++i) ASSERT_EQ(system_.Post("busy", Numbered(i)), SendResult::kAccepted);
  all_posted.Open();
  is_in_handler.Pass();
  system_.OnPeerChanged(2, true);
  gate.Open();
  EXPECT_THAT(heard_.Next(5), ElementsAre("1", "2", "peer", "3", "4"));
}

TEST_F(ActorSystemTest, PostWaitsForRoomInABlockingMailbox) {
  constexpr int kMessages = 2000;
  constexpr int kThreads = 4;
  SpawnOptions options;
  options.messages_max = 8;
  options.overflow = Overflow::kBlock;
  std::atomic<int> handled = 0;
  system_.Spawn("slow", options, OnEachMessage([&](Context&, const proto::Message&) {
                  if (++handled == kThreads * kMessages) heard_.Add("all");
                }));
  system_.Start(nullptr);
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < kMessages; ++i) ASSERT_EQ(system_.Post("slow", Numbered(i)), SendResult::kAccepted);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(heard_.Next(), "all");
}

TEST_F(ActorSystemTest, StopReleasesAPosterThatWaitsForRoom) {
  Gate gate;
  SpawnOptions options;
  options.messages_max = 1;
  options.overflow = Overflow::kBlock;
  system_.Spawn("full", options, OnEachMessage(nullptr));
  // The system is not started, so no message is handled.
  ASSERT_EQ(system_.Post("full", {}), SendResult::kAccepted);
  std::thread poster([&] {
    gate.Open();
    EXPECT_EQ(system_.Post("full", {}), SendResult::kUnreachable);
  });
  gate.Pass();
  system_.Stop();
  poster.join();
}

TEST_F(ActorSystemTest, ActorsNeverWaitForRoom) {
  SpawnOptions options;
  options.messages_max = 1;
  options.overflow = Overflow::kBlock;
  system_.Spawn("full", options, OnEachMessage(nullptr));
  system_.Spawn("sender", {},
                Scripted(
                    [&](Context& context) {  // OnStart runs before any message is handled.
                      heard_.Add(ToString(context.Send({1, "full"}, {})));
                      heard_.Add(ToString(context.Send({1, "full"}, {})));
                    },
                    nullptr));
  system_.Start(nullptr);
  EXPECT_THAT(heard_.Next(2), ElementsAre("accepted", "full"));
}

TEST_F(ActorSystemTest, AgentGivesUpItsRoleBeforeAnActorFailsPermanently) {
  ActorSystem::Options options = DefaultOptions();
  options.restarts_max = 2;
  options.restart_period = milliseconds(200);
  options.on_fatal = [this](const Error& error) { heard_.Add(error.text); };
  ActorSystem system(options);
  system.Spawn("role", {}, OnEachMessage([this](Context&, const proto::Message& message) {
                 heard_.Add("step down: " + message.step_down().actor() + ", " + message.step_down().reason());
               }));
  system.Spawn("broken", {},
               OnEachMessage([](Context&, const proto::Message&) { throw std::runtime_error("no GPU"); }));
  system.Start(nullptr);
  for (int i = 0; i < 6; ++i) (void)system.Post("broken", {});
  EXPECT_EQ(heard_.Next(), "step down: broken, no GPU");
  EXPECT_EQ(heard_.Next(), "actor 1/broken has failed permanently: no GPU");
  system.Stop();
}

TEST_F(ActorSystemTest, DeadLettersAndTraceRecordFailures) {
  system_.Spawn("a", {}, OnEachMessage([](Context& context, const proto::Message& message) {
                  (void)context.Send({1, "nobody"}, Numbered(message.request_id()));
                  throw std::runtime_error("cannot digest this");
                }));
  system_.Spawn("b", {},
                Scripted(
                    [](Context& context) {
                      context.Monitor({1, "a"});
                    },
                    [this](Context&, const proto::Message&) { heard_.Add("a died"); }));
  system_.Start(nullptr);
  proto::Message message = Numbered(42);
  message.mutable_optimize_request();
  ASSERT_EQ(system_.Post("a", std::move(message)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "a died");
  system_.Stop();
  proto::TraceRequest request;
  request.set_actor("a");
  const proto::TraceReply reply = system_.Trace(request);
  EXPECT_EQ(reply.dead_letter_count(), 1);
  ASSERT_THAT(reply.dead_letters(), SizeIs(1));
  EXPECT_EQ(reply.dead_letters(0).actor(), "a");
  EXPECT_EQ(reply.dead_letters(0).from_actor(), "outside");
  EXPECT_EQ(reply.dead_letters(0).body(), "optimize_request");
  EXPECT_EQ(reply.dead_letters(0).error().text(), "cannot digest this");
  std::vector<std::string> events;
  for (const proto::TraceEvent& event : reply.events()) {
    events.push_back(proto::TraceKind_Name(event.kind()) + " " + event.result() + " " +
                     std::to_string(static_cast<int>(event.request_id())));
  }
  EXPECT_THAT(events, testing::UnorderedElementsAre("TRACE_STARTED  1", "TRACE_REFUSED no such actor 42",
                                                    "TRACE_HANDLED  42", "TRACE_FAILED  0", "TRACE_STARTED  2"));
}

TEST_F(ActorSystemTest, WatchdogEndsTheProcessForAnActorThatGetsNoTurn) {
  ActorSystem::Options options = DefaultOptions();
  options.health_period = milliseconds(1);
  options.stuck_after = milliseconds(20);
  options.on_fatal = [this](const Error& error) { heard_.Add(error.text); };
  std::atomic<int> healthy_count = 0;
  Heard<int> healthy;
  options.on_healthy = [&] { healthy.Add(++healthy_count); };
  Gate gate;
  ActorSystem system(options);
  SpawnOptions spawn;
  spawn.handler_limit = milliseconds(1);
  system.Spawn("stuck", spawn, OnEachMessage([&](Context&, const proto::Message&) { gate.Pass(); }));
  // Its timers share the queue of the health checks, so 20 of them show that checks have passed.
  Heard<bool> ticked;
  int ticks = 0;
  system.Spawn("ticker", {}, OnEachMessage([&](Context& context, const proto::Message&) {
                 if (++ticks == 20) return ticked.Add(true);
                 context.AfterTimer(options.health_period, /*kind=*/1);
               }));
  system.Start(nullptr);
  EXPECT_EQ(healthy.Next(), 1);
  ASSERT_EQ(system.Post("stuck", {}), SendResult::kAccepted);
  EXPECT_THAT(heard_.Next(), HasSubstr("1/stuck has failed permanently: it did not answer the watchdog in time"));
  const int count_at_the_failure = healthy_count;
  ASSERT_EQ(system.Post("ticker", {}), SendResult::kAccepted);
  EXPECT_TRUE(ticked.Next());
  EXPECT_EQ(healthy_count, count_at_the_failure);
  gate.Open();
  system.Stop();
}

TEST_F(ActorSystemTest, StatusReportsHandlingTimesAndOverruns) {
  SpawnOptions spawn;
  spawn.handler_limit = Duration::zero();
  system_.Spawn("a", spawn, OnEachMessage([&](Context& context, const proto::Message& message) {
                  if (message.request_id() == 1) return;
                  for (const proto::ActorStatus& actor : context.GetSystemStatus().actors) {
                    EXPECT_EQ(actor.overruns(), 1);
                    EXPECT_GT(actor.longest_handler_s(), 0);
                    EXPECT_EQ(actor.handling_s(), actor.longest_handler_s());
                    EXPECT_EQ(actor.handled(), 2);
                    EXPECT_LT(actor.ping_s(), 0);
                  }
                  heard_.Add("told");
                }));
  system_.Start(nullptr);
  ASSERT_EQ(system_.Post("a", Numbered(1)), SendResult::kAccepted);
  ASSERT_EQ(system_.Post("a", Numbered(2)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "told");
}

TEST_F(ActorSystemTest, StopIsRequestedAfterTheHandler) {
  ActorSystem::Options options = DefaultOptions();
  options.on_stop_requested = [this] { heard_.Add("stop"); };
  ActorSystem system(options);
  system.Spawn("gateway", {}, OnEachMessage([this](Context& context, const proto::Message&) {
                 context.RequestStop();
                 heard_.Add("handler");
               }));
  system.Start(nullptr);
  ASSERT_EQ(system.Post("gateway", {}), SendResult::kAccepted);
  EXPECT_THAT(heard_.Next(2), ElementsAre("handler", "stop"));
  system.Stop();
}

TEST_F(ActorSystemTest, StopIsVisibleToLongWorkAndDropsWaitingMessages) {
  system_.Spawn("solver", {.placement = Placement::kOwnThread},
                OnEachMessage([&](Context& context, const proto::Message& message) {
                  heard_.Add("begin " + std::to_string(message.request_id()));
                  while (!context.stop_requested()) std::this_thread::yield();
                  heard_.Add("end");
                }));
  system_.Start(nullptr);
  ASSERT_EQ(system_.Post("solver", Numbered(1)), SendResult::kAccepted);
  ASSERT_EQ(system_.Post("solver", Numbered(2)), SendResult::kAccepted);
  EXPECT_EQ(heard_.Next(), "begin 1");
  system_.Stop();
  EXPECT_EQ(heard_.Next(), "end");
  EXPECT_TRUE(heard_.empty());
  EXPECT_EQ(system_.Post("solver", {}), SendResult::kUnreachable);
  system_.Stop();
}

class Farewell final : public Actor {
 public:
  Farewell(Heard<std::string>* heard, std::string name) : heard_(heard), name_(std::move(name)) {}
  ~Farewell() override { heard_->Add("end " + name_); }
  void OnMessage(Context&, const proto::Message&) override {}

 private:
  Heard<std::string>* heard_;
  std::string name_;
};

TEST_F(ActorSystemTest, ActorsStopInReverseOrder) {
  for (const std::string name : {"a", "b", "c"}) {
    const Placement placement = name == "b" ? Placement::kOwnThread : Placement::kPool;
    system_.Spawn(name, {.placement = placement}, [this, name] { return std::make_unique<Farewell>(&heard_, name); });
  }
  system_.Start(nullptr);
  system_.Stop();
  EXPECT_THAT(heard_.Next(3), ElementsAre("end c", "end b", "end a"));
}

TEST_F(ActorSystemTest, ASystemThatWasNeverStartedStops) {
  system_.Spawn("a", {.placement = Placement::kOwnThread}, OnEachMessage(nullptr));
  system_.Stop();
}

TEST_F(ActorSystemTest, ManyActorsHandleManyMessagesDespiteFailures) {
  // Eight actors pass 32 messages on at random, and one in 5000 handler calls fails. No actor may handle two messages
  // at the same time. The system stops while the actors still run.
  ActorSystem::Options options = DefaultOptions();
  options.worker_count = 4;
  options.restarts_max = 1'000'000;
  ActorSystem system(options);
  std::atomic<int> handled = 0;
  std::promise<void> enough;
  for (int i = 0; i < 8; ++i) {
    const Placement placement = i % 4 == 0 ? Placement::kOwnThread : Placement::kPool;
    system.Spawn(
        std::to_string(i), {.placement = placement},
        OnEachMessage([&, busy = std::make_shared<std::atomic<bool>>()](Context& context, const proto::Message&) {
          EXPECT_FALSE(busy->exchange(true));
          const int count = ++handled;
          if (count == 20'000) enough.set_value();
          const std::string next = std::to_string(context.rng()() % 8);
          (void)context.Send({1, next}, {});
          context.Cancel(context.AfterTimer(milliseconds(1), 1));
          busy->store(false);
          if (count % 5000 == 0) throw std::runtime_error("every five-thousandth");
        }));
  }
  system.Start(nullptr);
  for (int i = 0; i < 32; ++i) ASSERT_EQ(system.Post(std::to_string(i % 8), {}), SendResult::kAccepted);
  EXPECT_EQ(enough.get_future().wait_for(kPatience), std::future_status::ready);
  system.Stop();
}

}  // namespace
}  // namespace moondb
