// SimulatedTeam: the runtime on one thread, under a virtual clock and a seed. For tests of actors, yours too.
//
// Any number of agents, their actors, and a radio between them that can lose, delay, repeat and cut. Nothing is
// concurrent: each message is handled to completion, messages between agents are serialised and parsed on the way,
// time moves only when asked to. The same calls with the same seed give the same run.
//
//   SimulatedTeam team(/*seed=*/1);
//   team.AddAgent(1);
//   team.Spawn(1, "sync", [] { return std::make_unique<SyncActor>(...); });
//   team.Post({1, "test"}, {1, "sync"}, share_request);       // Answers to 1/test wait in Take.
//   team.AdvanceTime(seconds(6));
//   EXPECT_EQ(team.Take({2, "sync"}).size(), 2u);             // 2/sync is not spawned, so it is a probe.
//
// Supervision is ActorSystem's: a failed actor is made anew at once, again within a minute only after a delay of
// virtual time; one that is beyond help crashes its agent. Context::RequestStop ends the agent after the handler.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "runtime/actor.h"
#include "runtime/simulation/simulated_radio.h"

namespace moondb::simulation {

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
  // actor: kFull, kNoPeer, and kUnreachable for a link whose cut was told; also where the agent of `from` is not
  // running.
  SendResult Post(const Address& from, const Address& to, proto::Message message);

  // Messages that came to an address where no actor is, of an agent of the team or of {kClients, connection}, oldest
  // first; empties it. At most 100,000 are kept in all, later ones dropped.
  std::vector<proto::Message> Take(const Address& address);

  // Handles everything that is due now; time stands still. Fails a Check after 1,000,000 messages: a loop.
  void RunUntilIdle();
  // Runs all that comes due within `duration`, in order of time.
  void AdvanceTime(Duration duration);
  // Advances event by event until `condition`; false if `limit` of virtual time passed or nothing more can happen.
  bool RunUntil(const std::function<bool()>& condition, Duration limit);

  MonotonicTime now() const;
  std::int64_t utc_now_ns() const;  // Starts at 2026-01-01.

  // Drops the agent's actors, timers, mailboxes, roles, outbox and what is in the air to it, as kill -9 does. Nobody is
  // told (SetLink does that). Called while one of its handlers runs: what the handler still sends is refused.
  void Crash(AgentId agent);
  // Makes its actors anew, in the order of spawning.
  void Restart(AgentId agent);
  bool is_running(AgentId agent) const;

  RadioOptions& radio();
  // Cuts or joins the link in both directions and tells both ends (PeerEvent to role, sync, replica) where `tell`. What
  // is in the air when it is cut is lost. An end that was not told loses what it sends; one that was gets kUnreachable.
  void SetLink(AgentId a, AgentId b, bool is_up, bool tell = true);
  // Sees each message on its way between agents; returning false loses it.
  void SetFilter(std::function<bool(AgentId from, AgentId to, const proto::Message&)> filter);

  std::uint64_t radio_bytes() const;            // Serialised bytes sent between agents, lost ones too.
  std::uint64_t restarts(AgentId agent) const;  // Of its actors, by Fail or exceptions.
  std::uint64_t trace_hash() const;             // Of every delivery so far: equal for equal runs.

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb::simulation
