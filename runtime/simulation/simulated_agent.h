// SimulatedAgent: one agent of a SimulatedTeam, with its actors, mailboxes and supervision. It corresponds to an
// ActorSystem in its own process.
//
// Every delayed action is an event in the team's queue. An event has no effect if the agent has crashed since the event
// was added (boot() differs). An actor's timer also has no effect if the actor's incarnation has ended.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "runtime/actor.h"
#include "runtime/dead_letters.h"
#include "runtime/mailbox.h"
#include "runtime/monitors.h"
#include "runtime/role_table.h"
#include "runtime/simulation/fault.h"
#include "runtime/system_status.h"
#include "runtime/timer_queue.h"
#include "runtime/trace_book.h"

namespace moondb::simulation {

class SimulatedAgent;

// The part of SimulatedTeam that an agent uses.
class AgentSurroundings {
 public:
  using Event = std::function<void()>;

  virtual ~AgentSurroundings() = default;
  virtual MonotonicTime now() const = 0;
  virtual std::int64_t utc_now_ns() const = 0;  // True UTC, without the agent's clock offset.
  virtual TimerQueue<Event>& events() = 0;
  virtual SendResult Send(const Address& from, const Address& to, proto::Message message) = 0;
  // Delivers `message` to the actor at `to`. If no actor has this address, keeps the message for
  // SimulatedTeam::TakeMessages. `sender`: see Mailbox::Item.
  virtual SendResult HandOver(const Address& to, OwnedMessage message, const Address* sender) = 0;
  // Returns a pointer to a copy of `sender` that stays valid as long as the team exists.
  virtual const Address* Remember(const Address& sender) = 0;
  virtual Fault FaultFor(const Address& actor, const proto::Message& message) = 0;
  virtual void Trace(const Address& to, const Address& sender, const proto::Message& message) = 0;
  virtual std::vector<proto::PeerStatus> PeersOf(const SimulatedAgent& agent) const = 0;
  virtual void OnCrashed(AgentId agent) = 0;
};

class SimulatedAgent {
 public:
  struct SpawnedActor {
    std::string name;
    ActorFactory factory;
    SpawnOptions options;
    std::uint16_t trace_name = 0;
  };

  // Traffic with one peer since the start of this agent's process.
  struct PeerCounters {
    std::uint64_t sent_messages = 0;
    std::uint64_t sent_bytes = 0;
    std::uint64_t received_messages = 0;
    std::uint64_t received_bytes = 0;
    std::optional<MonotonicTime> heard;
  };

  // Creates a running agent without actors. Requires: `team` outlives it.
  SimulatedAgent(AgentSurroundings& team, AgentId id, std::uint64_t seed);
  ~SimulatedAgent();

  AgentId id() const { return id_; }
  bool is_running() const { return is_running_; }
  std::uint64_t boot() const { return boot_; }  // Number of the process, from 1; each crash increments it.
  MonotonicTime crashed() const { return crashed_; }
  std::uint64_t restarts() const { return restarts_; }
  Duration utc_offset() const { return utc_offset_; }
  void SetUtcOffset(Duration offset) { utc_offset_ = offset; }
  std::map<AgentId, PeerCounters>& peers() { return peers_; }
  const std::map<AgentId, PeerCounters>& peers() const { return peers_; }

  void SetBaseStation(AgentId base_station) { roles_.SetBaseStation(base_station); }
  // Sets the agents that the aliases resolve to, now and after each restart.
  void SetRoles(const proto::RoleAssignment& roles);
  AgentId Resolve(AgentId agent) const { return roles_.Resolve(agent); }

  void Spawn(SpawnedActor spawned);
  void Crash();
  // Starts the agent again with all its spawned actors. `connected` lists the peers that the agent can reach.
  void Restart(const std::vector<AgentId>& connected);
  void CrashActor(const std::string& actor);

  // OnPeerChanged: call when a peer connects or disconnects; notifies the actors that watch peers. OnPeerAtStart: call
  // for each peer that is connected when the agent starts; actors are notified when they begin to watch.
  void OnPeerChanged(AgentId peer, bool is_connected);
  void OnPeerAtStart(AgentId peer) { (void)monitors_.OnPeerChanged(peer, true); }
  void Watch(const std::string& actor, Topic topic) { Notify(monitors_.Watch(actor, topic)); }

  // Pushes `message` into the mailbox of `actor`. Returns the result, or nothing if no actor of that name was spawned.
  std::optional<SendResult> Push(const std::string& actor, OwnedMessage& message, const Address* sender);

  SystemStatus Status() const;
  proto::TraceReply Trace(const proto::TraceRequest& request) const;

 private:
  class Host;

  void MakeHost(const SpawnedActor& spawned);
  void StartHost(Host& host);
  // Processes the end of a handler. `item` is the handled message; null in OnStart and between messages. `failure`: the
  // handler's error, if it failed. Returns true if the actor must be restarted immediately.
  bool SettleHandler(Host& host, Mailbox::Item* item, const std::optional<Error>& failure);
  bool Recover(Host& host, Mailbox::Item* item, const Error& failure);
  void StepDown(const Host& failed, const Error& failure);
  std::optional<Error> Handle(Host& host, const Mailbox::Item& item);
  void ScheduleStep(Host& host);
  void Step(Host& host);
  Host* FindHost(const std::string& actor) const;
  TimerId StartTimer(Host& host, Duration delay, proto::Message message);
  void Notify(Monitors::Notices notices);

  AgentSurroundings& team_;
  const AgentId id_;
  const std::uint64_t seed_;
  bool is_running_ = true;
  std::uint64_t boot_ = 1;
  MonotonicTime started_;
  MonotonicTime crashed_;
  Duration utc_offset_{};
  RoleTable roles_;
  proto::RoleAssignment given_roles_;  // Roles to apply at each start of the process.
  std::vector<SpawnedActor> spawned_;
  std::vector<std::unique_ptr<Host>> hosts_;  // One Host per element of spawned_, in the same order.
  std::uint64_t restarts_ = 0;
  std::map<AgentId, PeerCounters> peers_;
  Monitors monitors_;
  TraceBook trace_;  // The trace and the dead letters are kept across restarts.
  DeadLetters dead_letters_;
};

}  // namespace moondb::simulation
