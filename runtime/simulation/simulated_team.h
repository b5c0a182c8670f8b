// SimulatedTeam: the runtime on one thread, under a virtual clock and a seed. For tests of actors, yours too.
//
// Any number of agents, their actors, and a radio between them that can lose, delay, repeat and cut. Nothing is
// concurrent: each message is handled to completion, messages between agents are serialised and parsed on the way,
// time moves only when asked to. The same calls with the same seed give the same run.
//
//   SimulatedTeam team(/*seed=*/1);
//   team.AddAgent(1);
//   team.Spawn(1, "sync", [] { return std::make_unique<SyncActor>(...); });
//   team.AddAgent(2);
//   (void)team.Post({1, "test"}, {1, "sync"}, share_request); // Answers to 1/test wait in Take.
//   team.AdvanceTime(seconds(6));
//   EXPECT_EQ(team.Take({2, "sync"}).size(), 2u);             // 2/sync is not spawned, so it is a probe.
//
// Supervision is ActorSystem's: a failed actor is made anew at once, again within a minute only after a delay of
// virtual time; one that is beyond help crashes its agent. Context::RequestStop ends the agent after the handler. All
// agents of the team count as connected until SetLink or Partition says otherwise.
//
// Different from ActorSystem: nothing waits for room (Overflow::kBlock refuses as kReject does), and there is no
// watchdog, as a handler takes no virtual time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proto/trace.pb.h"
#include "runtime/actor.h"
#include "runtime/simulation/simulated_radio.h"

namespace moondb::simulation {

// What SetFault makes of a message that an actor is about to handle. The actor is then made anew as after Fail.
enum class Fault {
  kNone,
  kBeforeHandler,   // It fails in place of handling the message.
  kAtFirstSend,     // Its first Send or Publish has no effect and does not return (if there is none: as kAfterHandler).
  kAfterFirstSend,  // Its first Send or Publish is carried out and does not return (if there is none: as
                    // kAfterHandler).
  kAfterHandler,    // It fails when all is done and sent.
};

class SimulatedTeam {
 public:
  explicit SimulatedTeam(std::uint64_t seed);
  ~SimulatedTeam();

  void AddAgent(AgentId agent);
  void SetBaseStation(AgentId agent);  // What @base stands for, on every agent.
  // What @leader and @survivor stand for on `agent`, as if its RoleActor had said so; again so after each Restart.
  void SetRoles(AgentId agent, const proto::RoleAssignment& roles);

  // Starts the actor at once (OnStart runs before this returns).
  void Spawn(AgentId agent, std::string name, ActorFactory factory, SpawnOptions options = {});

  // Sends as `from` (which need not be an actor, nor its agent of the team). Delivered by the next run. As for an
  // actor: kFull, kNoPeer, and kUnreachable for a link whose cut was notified; also where the agent of `from` is not
  // running.
  SendResult Post(const Address& from, const Address& to, proto::Message message);

  // Advances event by event until a message with that body comes to `probe`, takes it and all before it. Nothing if
  // `limit` of virtual time passes first.
  std::optional<proto::Message> Expect(const Address& probe, proto::Message::BodyCase body, Duration limit);

  // Messages that came to an address where no actor is, of an agent of the team or of {kClients, connection}, oldest
  // first; empties it. At most 100,000 are kept in all, later ones dropped.
  std::vector<proto::Message> Take(const Address& address);

  // From now on what is published on `topic` comes to `actor`, which was not spawned: kept for Take. Until its agent
  // crashes.
  void Watch(const Address& actor, Topic topic);

  // From now on what `actor` sends is kept for TakeSent, wherever it goes, if it was not refused; at most 100,000
  // messages.
  void RecordSent(const Address& actor);
  std::vector<proto::Message> TakeSent(const Address& actor);  // Oldest first; empties it.

  // Handles everything that is due now; time stands still. Fails a Check after 1,000,000 messages: a loop.
  void RunUntilIdle();
  // Runs all that comes due within `duration`, in order of time.
  void AdvanceTime(Duration duration);
  // Advances event by event until `condition`; false if `limit` of virtual time passed or nothing more can happen.
  bool RunUntil(const std::function<bool()>& condition, Duration limit);

  MonotonicTime now() const;
  std::int64_t utc_now_ns() const;  // Starts at 2026-01-01.
  // From now on the clock of `agent` is off by so much; its monotonic one is not.
  void SetUtcOffset(AgentId agent, Duration offset);

  // Drops the agent's actors, timers, mailboxes, roles, outbox and what is in the air to it, as kill -9 does. Nobody is
  // notified (SetLink does that). Called while one of its handlers runs: what the handler still sends is refused.
  void Crash(AgentId agent);
  // Makes its actors anew, in the order of spawning.
  void Restart(AgentId agent);
  bool is_running(AgentId agent) const;

  // The actor fails now, between two messages, as if by Context::Fail.
  void CrashActor(const Address& actor);
  // Asked before each message that an actor handles, until another function or an empty one is set.
  void SetFault(std::function<Fault(const Address& actor, const proto::Message&)> fault);

  RadioOptions& radio();
  // Cuts or joins the link in both directions and notifies both ends (those who watch peers) where `tell`. What
  // is in the air when it is cut is lost. An end that was not notified loses what it sends; one that was gets
  // kUnreachable.
  void SetLink(AgentId a, AgentId b, bool is_up, bool tell = true);
  // Cuts (and notifies of) all links between agents of different groups, joins all others; agents in no group are one
  // more.
  void Partition(const std::vector<std::vector<AgentId>>& groups);
  void Heal() { Partition({}); }
  // Sees each message on its way between agents; returning false loses it.
  void SetFilter(std::function<bool(AgentId from, AgentId to, const proto::Message&)> filter);

  std::uint64_t radio_bytes() const;            // Serialised bytes sent between agents, lost ones too.
  std::uint64_t restarts(AgentId agent) const;  // Of its actors, by Fail or exceptions.
  std::uint64_t trace_hash() const;             // Of every delivery so far: equal for equal runs.
  // What Context says of it to its actors (runtime/system_status.h).
  SystemStatus GetSystemStatus(AgentId agent) const;
  proto::TraceReply GetTrace(AgentId agent, const proto::TraceRequest& request = {}) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb::simulation
