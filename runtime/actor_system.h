// ActorSystem: runs one agent's actors on a small worker pool and on threads of their own.
//
// Threads sleep when there is nothing to do. An actor's messages are handled one at a time, in the order in which each
// sender sent them, control messages first (runtime/actor.h). Supervision is one for one: an exception that leaves a
// handler, or Context::Fail, destroys the actor and makes it anew by its factory, at once the first time, then with a
// growing delay (Supervisor); its mailbox survives, the message that killed it goes to the dead letters. One that fails
// too often makes the agent give up its role (a StepDown to the actor `role`); if that does not help, it is beyond
// help, which ends the process by on_fatal. An actor is made, run and destroyed on its own thread, if it has one (an
// EGL context belongs to its thread).
//
// A watchdog looks at actors that have work each `health_period`: a handler over its limit is logged, an actor that
// gets no turn for `stuck_after` is fatal, since nothing but a new process can help it.
//
// A message to an actor that is beyond help, or after Stop, is kUnreachable.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "runtime/actor.h"
#include "runtime/trace_book.h"
#include "runtime/transport.h"

namespace moondb {

class ActorSystem {
 public:
  struct Options {
    AgentId self = 0;
    AgentId base_station = 0;  // What @base stands for; 0: nobody.
    int worker_count = 2;
    int restarts_max = 5;
    Duration restart_period = std::chrono::minutes(1);
    Duration health_period = std::chrono::seconds(10);
    Duration stuck_after = std::chrono::minutes(15);
    std::uint64_t seed = 0;  // Of the actors' rng(); 0: from the system's entropy.
    // An actor is beyond help. Called once, on one of the system's threads: must not Stop there. Default: abort.
    std::function<void(Error)> on_fatal;
    // Context::RequestStop. Called on some actor's thread: must not Stop there. Default: nothing happens.
    std::function<void()> on_stop_requested;
  };

  explicit ActorSystem(Options options);
  ~ActorSystem();  // Stops.

  // Before Start only; names are unique. Actors are started in the order of spawning and stopped in reverse.
  void Spawn(std::string name, SpawnOptions options, ActorFactory factory);

  // Runs OnStart of each actor (those that fail are made anew first), then lets messages flow. `transport` may be null
  // (no peers, no clients), must outlive Stop, and may deliver only from now on.
  void Start(Transport* transport);

  // Any thread. Delivers to the actor that message.destination_actor names on this agent; how the transport hands in
  // what it received. The actor learns from Context::sender who sent it; the message itself need no longer say so.
  SendResult Deliver(OwnedMessage message);

  // Any thread, before Start too: a peer was reached or lost. Actors that watch peers or monitor that agent are
  // notified.
  void OnPeerChanged(AgentId peer, bool is_connected);

  // Sends from outside any actor, not from a handler; the sender is {self, "outside"}. For tests and composition. Waits
  // for room in a full mailbox of an Overflow::kBlock actor, until Stop if need be.
  SendResult Post(const std::string& actor, OwnedMessage message);

  // Idempotent; not from a handler. Sets stop_requested, lets running handlers end, destroys the actors, joins all
  // threads. Waiting messages are dropped.
  void Stop();

  // Any thread: what the agent's actors did last.
  proto::TraceReply Trace(const proto::TraceRequest& request) const;
  // The same as it is kept, for DumpTraceOnCrash. Lives as long as the system.
  const TraceBook& trace_book() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb
