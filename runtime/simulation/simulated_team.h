// SimulatedTeam: the runtime on one thread, with a virtual clock and a seed. For tests of actors, including those of
// users.
//
// Runs any number of agents, their actors, and a radio that can lose, delay and duplicate messages and whose links can
// be cut. Nothing runs concurrently. Each message is handled to completion. Messages between agents are serialised and
// parsed. Time advances only on request. The same calls with the same seed give the same run.
//
//   SimulatedTeam team(/*seed=*/1);
//   team.AddAgent(1);
//   team.Spawn(1, "sync", [] { return std::make_unique<SyncActor>(...); });
//   team.AddAgent(2);
//   (void)team.Post({1, "test"}, {1, "sync"}, share_request); // Answers to 1/test are kept for Take.
//   team.AdvanceTime(seconds(6));
//   EXPECT_EQ(team.Take({2, "sync"}).size(), 2u);             // 2/sync is not spawned, so it is a probe.
//
// Supervision works as in ActorSystem. A failed actor restarts immediately; a repeated failure within a minute delays
// the restart in virtual time. A permanent failure crashes the agent. Context::RequestStop ends the agent after the
// handler. All agents of the team count as connected until SetLink or Partition changes that.
//
// Differences from ActorSystem: no sender waits for room (Overflow::kBlock refuses like kReject). There is no watchdog,
// because a handler takes no virtual time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proto/trace.pb.h"
#include "runtime/actor.h"
#include "runtime/simulation/fault.h"
#include "runtime/simulation/simulated_radio.h"

namespace moondb::simulation {

class SimulatedTeam {
 public:
  explicit SimulatedTeam(std::uint64_t seed);
  ~SimulatedTeam();

  void AddAgent(AgentId agent);
  void SetBaseStation(AgentId agent);  // The agent that @base resolves to, on every agent.
  // Sets the agents that @leader and @survivor resolve to on `agent`, as its RoleActor would. Applied again after each
  // Restart.
  void SetRoles(AgentId agent, const proto::RoleAssignment& roles);

  // Adds an actor and starts it: OnStart runs before this returns.
  void Spawn(AgentId agent, std::string name, ActorFactory factory, SpawnOptions options = {});

  // Sends a message with the sender `from`, which need not be an actor or belong to the team. The next run delivers it.
  // Returns kFull or kNoPeer as for an actor. Returns kUnreachable if the link is cut and its ends were notified, or if
  // the agent of `from` is not running.
  SendResult Post(const Address& from, const Address& to, proto::Message message);

  // Advances event by event until a message with that body arrives at `probe`. Removes and returns it, and drops all
  // messages before it. Returns nothing if `limit` of virtual time passes first.
  std::optional<proto::Message> Expect(const Address& probe, proto::Message::BodyCase body, Duration limit);

  // Removes and returns the messages that arrived at an address without an actor, oldest first. `address` belongs to an
  // agent of the team, or is {kClients, name of a connection}. At most 100,000 messages are kept for all addresses
  // together; later ones are dropped.
  std::vector<proto::Message> Take(const Address& address);

  // Subscribes the address `actor`, at which no actor was spawned, to `topic`. The published messages are kept for
  // Take. The subscription ends when the agent crashes.
  void Watch(const Address& actor, Topic topic);

  // Starts to record the messages that `actor` sends, for TakeSent. Refused messages are not recorded. At most 100,000
  // messages are kept.
  void RecordSent(const Address& actor);
  // Removes and returns the recorded messages, oldest first.
  std::vector<proto::Message> TakeSent(const Address& actor);

  // Runs all events that are due now; time does not advance. Fails a Check after 1,000,000 events, which means a loop.
  void RunUntilIdle();
  // Runs all events due within `duration`, in order of time.
  void AdvanceTime(Duration duration);
  // Advances event by event until `condition` is true. Returns false if `limit` of virtual time passes or no event is
  // left.
  bool RunUntil(const std::function<bool()>& condition, Duration limit);

  MonotonicTime now() const;
  std::int64_t utc_now_ns() const;  // UTC, starting at 2026-01-01.
  // Shifts the UTC clock of `agent` by `offset`. Its monotonic clock is not affected.
  void SetUtcOffset(AgentId agent, Duration offset);

  // Crashes the agent like kill -9: drops its actors, timers, mailboxes, roles, outbox and the messages in flight to
  // it. Peers are not notified (SetLink does that). If one of its handlers is running, further sends of that handler
  // are refused.
  void Crash(AgentId agent);
  // Restarts the agent and its actors, in the order of spawning.
  void Restart(AgentId agent);
  bool is_running(AgentId agent) const;

  // Makes the actor fail between two messages, as if by Context::Fail.
  void CrashActor(const Address& actor);
  // Sets a function that is called before an actor handles a message, and returns the fault to inject. An empty
  // function removes it.
  void SetFault(std::function<Fault(const Address& actor, const proto::Message&)> fault);

  RadioOptions& radio();
  // Cuts or restores the link in both directions. If `tell`, notifies the watchers of peers at both ends. A cut loses
  // the messages in flight. After a cut, a notified end gets kUnreachable; an end that was not notified loses the
  // messages that it sends.
  void SetLink(AgentId a, AgentId b, bool is_up, bool tell = true);
  // Cuts all links between different groups and restores all others, with notification. Agents in no group form one
  // more group.
  void Partition(const std::vector<std::vector<AgentId>>& groups);
  void Heal() { Partition({}); }
  // Sets a function that is called for each message between agents. If it returns false, the message is lost.
  void SetFilter(std::function<bool(AgentId from, AgentId to, const proto::Message&)> filter);

  std::uint64_t radio_bytes() const;            // Serialised bytes sent between agents, including lost messages.
  std::uint64_t restarts(AgentId agent) const;  // Restarts of the agent's actors after Fail or exceptions.
  std::uint64_t trace_hash() const;             // Hash of every delivery so far: equal for equal runs.
  // The values that Context::GetSystemStatus and Context::GetTrace return to the agent's actors.
  SystemStatus GetSystemStatus(AgentId agent) const;
  proto::TraceReply GetTrace(AgentId agent, const proto::TraceRequest& request = {}) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb::simulation
