// ActorSystem: runs one agent's actors on a small worker pool and on threads of their own.
//
// Threads sleep when there is nothing to do. An actor's messages are handled one at a time, in the order in which each
// sender sent them. Supervision is one for one: an exception that leaves a handler, or Context::Fail, destroys the
// actor and makes it anew by its factory, at once the first time, then with a growing delay; its mailbox survives, the
// message that killed it does not. More than `restarts_max` in `restart_period` end the process by on_fatal. An actor
// is made, run and destroyed on its own thread, if it has one (an EGL context belongs to its thread).
//
// A message to an actor that is beyond help, or after Stop, is kUnreachable.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "runtime/actor.h"
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
    std::uint64_t seed = 0;  // Of the actors' rng(); 0: from the system's entropy.
    // An actor is beyond help. Called once, on some actor's thread: must not Stop there. Default: abort.
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
  // what it received.
  SendResult Deliver(MessagePtr message);

  // Any thread: tells the actors `role`, `sync` and `replica`, where they exist, with a PeerEvent.
  void OnPeerChanged(AgentId peer, bool is_connected);

  // Sends from outside any actor; the sender is {self, "outside"}. For tests and composition.
  SendResult Post(const std::string& actor, proto::Message message);

  // Idempotent; not from a handler. Sets stop_requested, lets running handlers end, destroys the actors, joins all
  // threads. Waiting messages are dropped.
  void Stop();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb
