// Actor and Context: all that code on moondb's runtime sees of the world.
//
// An actor handles one message at a time, to completion, and never blocks on another actor. It reads no clock, opens
// no socket, starts no thread and draws no random number by itself: the Context gives these, so that one seed replays
// a whole team (runtime/simulation).
//
//   class Greeter final : public Actor {
//    public:
//     void OnMessage(Context& context, const proto::Message& message) override {
//       proto::Message reply;
//       reply.mutable_timer()->set_kind(1);
//       (void)context.Reply(std::move(reply));
//     }
//   };
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "model/error.h"
#include "proto/message.pb.h"
#include "runtime/address.h"

namespace moondb {

using Duration = std::chrono::nanoseconds;
// Monotonic, from an arbitrary start.
using MonotonicTime = std::chrono::time_point<std::chrono::steady_clock, Duration>;
using TimerId = std::uint64_t;
using MessagePtr = std::shared_ptr<const proto::Message>;

enum class SendResult {
  kAccepted,     // In the mailbox or the peer's outbox. Not yet handled, and to a peer not yet sent.
  kFull,         // The mailbox's or outbox's bound is reached; the message is dropped and counted.
  kNoActor,      // This agent has no actor of that name.
  kNoPeer,       // No such agent in the team, or an alias that stands for nobody now.
  kUnreachable,  // The peer or client is not connected.
};

const char* ToString(SendResult result);

// The system's own work for an agent that only some actors ask for.
struct SystemStatus {
  std::vector<proto::PeerStatus> peers;
  std::vector<proto::ActorStatus> actors;
  Duration uptime{};
};

// Valid only inside the handler that it was given to, on that thread.
class Context {
 public:
  virtual ~Context() = default;

  virtual const Address& self() const = 0;
  // Who sent the message in hand: its source actor at its hop sender; a client is {kClients, connection}.
  virtual const Address& sender() const = 0;
  virtual MonotonicTime now() const = 0;
  // UTC in nanoseconds since 1970, for stamps only.
  virtual std::int64_t utc_now_ns() const = 0;
  virtual std::mt19937_64& rng() = 0;

  // Fills in hop_sender, source_actor, destination_id and destination_actor; agent_id too where it is 0.
  // Never blocks. A refused message has no further effect.
  [[nodiscard]] virtual SendResult Send(const Address& to, proto::Message message) = 0;

  // Sends to sender() with the request_id of the message in hand.
  [[nodiscard]] virtual SendResult Reply(proto::Message message) = 0;

  // Sends `message` to this actor itself after `delay`. Timers die with the actor.
  virtual TimerId After(Duration delay, proto::Message message) = 0;
  virtual void Cancel(TimerId timer) = 0;  // Of one that already came due: nothing happens.

  // A timer whose message is Timer{kind, value}.
  TimerId AfterTimer(Duration delay, std::uint32_t kind, std::uint64_t value = 0);

  // This actor cannot go on: after the handler it is destroyed and made anew by its factory (OnStart again).
  virtual void Fail(Error error) = 0;

  // Polled by long work: the system is stopping.
  virtual bool stop_requested() const = 0;

  // RoleActor only: what the aliases stand for from now on.
  virtual void SetRoles(const proto::RoleAssignment& roles) = 0;
  // GatewayActor only: the process should end (exit code 0), after this handler.
  virtual void RequestStop() = 0;
  virtual SystemStatus GetSystemStatus() const = 0;
};

class Actor {
 public:
  virtual ~Actor() = default;
  // (Re)load state; called again on a new object after a restart.
  virtual void OnStart(Context&) {}
  virtual void OnMessage(Context&, const proto::Message& message) = 0;
};

using ActorFactory = std::function<std::unique_ptr<Actor>()>;

enum class Placement {
  kPool,       // Handlers are short.
  kOwnThread,  // Handlers may take long, or belong to one thread (fsync, EGL, a solver).
};

struct SpawnOptions {
  Placement placement = Placement::kPool;
  std::size_t messages_max = 4096;           // Waiting in the mailbox; at least 1.
  std::size_t bytes_max = 64 * 1024 * 1024;  // Of these, as serialised; one larger message fits alone.
};

}  // namespace moondb
