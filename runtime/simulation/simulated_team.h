// SimulatedTeam: the runtime on one thread, with a virtual clock and a seed. For tests of actors, including users'
// actors.
//
// Runs any number of agents, their actors, and a radio that can lose, delay and duplicate messages and whose links can
// be cut. Messages between agents are serialised and parsed. Time advances only on request. The same calls with the
// same seed give the same run.
//
//   SimulatedTeam team(/*seed=*/1);
//   team.AddAgent(1);
//   team.Spawn(1, "sync", [] { return std::make_unique<SyncActor>(...); });
//   team.AddAgent(2);
//   (void)team.Post({1, "test"}, {1, "sync"}, share_request); // TakeMessages({1, "test"}) returns the answers.
//   team.AdvanceTime(seconds(6));
//   EXPECT_EQ(team.TakeMessages({2, "sync"}).size(), 2u); // Kept, because 2/sync is not spawned.
//
// Supervision works as in ActorSystem, with delays in virtual time. A permanent failure crashes the agent.
// Context::RequestStop ends the agent after the handler. All agents count as connected until SetLink or Partition
// changes that.
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
  // Sets the agents to which @leader and @survivor resolve on `agent`, as its RoleActor would. Applied again after each
  // Restart.
  void SetRoles(AgentId agent, const proto::RoleAssignment& roles);

  // Adds an actor. Its OnStart runs before this returns.
  void Spawn(AgentId agent, std::string name, ActorFactory factory, SpawnOptions options = {});

  // Sends a message with the sender `from`, which need not be an actor or belong to the team. The next run delivers the
  // message. Returns kFull or kNoPeer as Context::Send does. Returns kUnreachable if the link is cut and its ends were
  // notified, or if the agent of `from` is not running.
  SendResult Post(const Address& from, const Address& to, proto::Message message);

  // Runs event by event until a message with this body has arrived at `probe`, an address without an actor. Removes and
  // returns the message, and drops the messages that arrived at `probe` before it. Returns nothing if `limit` of
  // virtual time passes first.
  std::optional<proto::Message> Expect(const Address& probe, proto::Message::BodyCase body, Duration limit);

  // Removes and returns the messages that arrived at `address`, oldest first. `address` is an address without an actor
  // at an agent of the team, or {kClients, name of a connection}. At most 100,000 messages are kept for all addresses
  // together; later ones are dropped.
  std::vector<proto::Message> TakeMessages(const Address& address);

  // Subscribes `actor`, an address without an actor, to `topic`. TakeMessages returns the published messages. The
  // subscription ends when the agent crashes.
  void Watch(const Address& actor, Topic topic);

  // Starts to record the messages that `actor` sends, for TakeSent. Refused messages are not recorded. At most 100,000
  // messages are kept for all actors together; later ones are not recorded.
  void RecordSent(const Address& actor);
  // Removes and returns the recorded messages, oldest first.
  std::vector<proto::Message> TakeSent(const Address& actor);

  // Runs all events that are due now; time does not advance. Fails a Check after 1,000,000 events, which indicates an
  // endless loop.
  void RunUntilIdle();
  // Runs all events due within `duration`, in order of time.
  void AdvanceTime(Duration duration);
  // Advances event by event until `condition` returns true. Returns false if `limit` of virtual time passes or no event
  // remains.
  bool RunUntil(const std::function<bool()>& condition, Duration limit);

  MonotonicTime now() const;
  std::int64_t utc_now_ns() const;  // UTC, starting at 2026-01-01.
  // Shifts the UTC clock of `agent` by `offset`. Its monotonic clock is not affected.
  void SetUtcOffset(AgentId agent, Duration offset);

  // Crashes the agent like kill -9: drops its actors, timers, mailboxes, roles and outbox, and the messages in flight
  // to it. Does not notify peers (use SetLink). If one of the agent's handlers is running, further sends of that
  // handler are refused.
  void Crash(AgentId agent);
  // Restarts the agent and its actors, in the order of spawning.
  void Restart(AgentId agent);
  bool is_running(AgentId agent) const;

  // Makes the actor fail between two messages, as if by Context::Fail.
  void CrashActor(const Address& actor);
  // Sets a function that is called before an actor handles a message and returns the fault to inject. An empty function
  // ends the injection.
  void SetFault(std::function<Fault(const Address& actor, const proto::Message&)> fault);

  RadioOptions& radio();
  // Cuts or restores the link in both directions. If `tell`, notifies the actors that watch peers at both ends. A cut
  // loses the messages in flight. After a cut, sends over the link return kUnreachable if `tell` was true; otherwise
  // they are accepted and lost.
  void SetLink(AgentId a, AgentId b, bool is_up, bool tell = true);
  // Cuts all links between different groups and restores all others, and notifies the agents. Agents that are in no
  // group form one more group.
  void Partition(const std::vector<std::vector<AgentId>>& groups);
  void Heal() { Partition({}); }
  // Sets a function that is called for each message between agents. If the function returns false, the message is lost.
  void SetFilter(std::function<bool(AgentId from, AgentId to, const proto::Message&)> filter);

  std::uint64_t radio_bytes() const;            // Serialised bytes sent between agents, including lost messages.
  std::uint64_t restarts(AgentId agent) const;  // Restarts of the agent's actors after Fail or exceptions.
  std::uint64_t trace_hash() const;             // Hash of every delivery so far: equal for equal runs.
  // Return what Context::GetSystemStatus and Context::GetTrace return to the agent's actors.
  SystemStatus GetSystemStatus(AgentId agent) const;
  proto::TraceReply GetTrace(AgentId agent, const proto::TraceRequest& request = {}) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb::simulation
