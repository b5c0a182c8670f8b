// ActorSystem: runs the actors of one agent on a small worker pool and on dedicated threads.
//
// An actor handles one message at a time. Messages of one sender are handled in the order of sending, and control
// messages before data (runtime/actor.h). An actor with Placement::kOwnThread is created, run and destroyed on its own
// thread. Sending to an actor that failed permanently, or after Stop, returns kUnreachable.
//
// If a handler throws or calls Context::Fail, its actor is destroyed and restarted through its factory: immediately the
// first time, then after a growing delay (Supervisor). Other actors continue, and the mailbox survives. The message
// that caused the failure becomes a dead letter. If an actor fails too often, the agent gives up its role (a StepDown
// to the actor `role`). If the actor still fails, it has failed permanently, and on_fatal ends the process.
//
// Every `health_period` a watchdog checks the actors that have work. It logs a handler that exceeds its limit. If an
// actor gets no turn for `stuck_after`, the watchdog calls on_fatal, because only a new process can recover from that.
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
    AgentId base_station = 0;  // The agent that @base resolves to; 0: none.
    int worker_count = 2;
    int restarts_max = 5;
    Duration restart_period = std::chrono::minutes(1);
    Duration health_period = std::chrono::seconds(10);
    Duration stuck_after = std::chrono::minutes(15);
    std::uint64_t seed = 0;  // Seed of the actors' rng(); 0: seed from system entropy.
    // Called once if an actor fails permanently or is stuck, on one of the system's threads. Must not call Stop. If
    // null, the process aborts.
    std::function<void(Error)> on_fatal;
    // Called every health_period while no actor is stuck or has failed permanently, on one of the system's threads. May
    // be null.
    std::function<void()> on_healthy;
    // Called on the actor's thread after a handler that called Context::RequestStop. Must not call Stop. May be null.
    std::function<void()> on_stop_requested;
  };

  explicit ActorSystem(Options options);
  ~ActorSystem();  // Calls Stop.

  // Adds an actor. Requires: Start was not called; `name` is unique. Actors start in the order of spawning and stop in
  // the reverse order.
  void Spawn(std::string name, SpawnOptions options, ActorFactory factory);

  // Runs OnStart of each actor, restarts actors that fail in it, and then starts message handling. `transport` may be
  // null (no peers, no clients). Otherwise `transport` must exist until Stop returns, and must not deliver messages
  // before this call.
  void Start(Transport* transport);

  // Delivers a message from the transport to the actor message.destination_actor of this agent. May clear the actors'
  // names in the message; the receiver reads the sender from Context::sender. Thread-safe.
  SendResult Deliver(OwnedMessage message);

  // Call when a peer connected or disconnected. Notifies actors that watch peers or monitor that agent. Thread-safe,
  // also before Start.
  void OnPeerChanged(AgentId peer, bool is_connected);

  // Sends a message from outside any actor; the sender is {self, "outside"}. For tests and setup code; must not be
  // called from a handler. If the mailbox is full and Overflow::kBlock applies, waits until there is room or Stop is
  // called.
  SendResult Post(const std::string& actor, OwnedMessage message);

  // Stops the system: sets stop_requested, waits for running handlers, destroys the actors and joins all threads.
  // Waiting messages are dropped. Idempotent. Must not be called from a handler.
  void Stop();

  // Returns the latest events of this agent's actors and its dead letters. Thread-safe.
  proto::TraceReply Trace(const proto::TraceRequest& request) const;
  // The trace itself, for DumpTraceOnCrash. Valid as long as this system exists.
  const TraceBook& trace_book() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace moondb
