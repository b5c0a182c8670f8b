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

#include "model/error.h"
#include "proto/message.pb.h"
#include "runtime/address.h"
#include "runtime/owned_message.h"

namespace moondb::proto {
class TraceReply;
class TraceRequest;
}  // namespace moondb::proto

namespace moondb {

using Duration = std::chrono::nanoseconds;
// Monotonic, from an arbitrary start.
using MonotonicTime = std::chrono::time_point<std::chrono::steady_clock, Duration>;
using TimerId = std::uint64_t;

enum class [[nodiscard]] SendResult{
    kAccepted,     // In the mailbox or the peer's outbox. Not yet handled, and to a peer not yet sent.
    kFull,         // The mailbox's or outbox's bound is reached; the message is dropped and counted.
    kNoActor,      // This agent has no actor of that name.
    kNoPeer,       // No such agent in the team, or an alias that stands for nobody now.
    kUnreachable,  // The peer or client is not connected.
    kTooLong,      // Longer than a message between agents may be (runtime/transport.h); dropped and counted.
};

const char* ToString(SendResult result);

// What one actor of an agent publishes for all others of it: Publish's message, each with its own body.
enum class Topic {
  kRoles = proto::Message::kRolesChanged,    // RoleActor: the assignment that stands.
  kLeases = proto::Message::kLeasesChanged,  // LeaseActor: who drives, sleeps or is paused.
  kStored = proto::Message::kRecordsStored,  // StorageActor: rows came, or were pruned.
};

struct SystemStatus;  // runtime/system_status.h

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

  // Takes the message, which may also be a proto::Message, moved. Fills in hop_sender and destination_id; agent_id too
  // where it is 0; and, for the way to another agent, source_actor and destination_actor (within an agent the names do
  // not travel: the receiver asks sender()). Never blocks. A refused message has no further effect.
  [[nodiscard]] virtual SendResult Send(const Address& to, OwnedMessage message) = 0;

  // Sends to sender() with the request_id of the message in hand.
  [[nodiscard]] virtual SendResult Reply(OwnedMessage message) = 0;

  // Sends `message` to this actor itself after `delay`, past its mailbox's bound. Timers die with the actor.
  virtual TimerId After(Duration delay, proto::Message message) = 0;
  virtual void Cancel(TimerId timer) = 0;  // Of one that already came due: nothing happens.

  // A timer whose message is Timer{kind, value}.
  TimerId AfterTimer(Duration delay, std::uint32_t kind, std::uint64_t value = 0);

  // This actor cannot go on: after the handler it is destroyed and made anew by its factory (OnStart again). With
  // kCorrupt nothing is made anew: the process ends.
  virtual void Fail(Error error) = 0;

  // From now on PeerEvents come, on the control lane: first one for each peer that is connected, then each change.
  virtual void WatchPeers() = 0;

  // From now on what is published on `topic` comes. Roles and leases: first what was published last, if anything was,
  // then each change, on the control lane. That something was stored or pruned (what is there already is read at the
  // start) comes on the data lane past its bounds: while one such message waits, later ones are added to it. Ends with
  // this incarnation.
  virtual void Watch(Topic topic) = 0;
  // RoleActor, LeaseActor and StorageActor only, each on its own topic.
  virtual void Publish(OwnedMessage message) = 0;

  // A Down comes, on the control lane, each time that `target` is lost: an actor of this agent whose incarnation ended
  // (the next one has the same address), or an agent to which the connection broke (with or without an actor's name: of
  // a remote actor alone nothing is heard). At once if there is no such actor or no connection now. Aliases are
  // resolved now. Ends with this incarnation or with Demonitor.
  virtual void Monitor(const Address& target) = 0;
  virtual void Demonitor(const Address& target) = 0;

  // Polled by long work: the system is stopping.
  virtual bool stop_requested() const = 0;

  // RoleActor only: what the aliases stand for from now on.
  virtual void SetRoles(const proto::RoleAssignment& roles) = 0;
  // GatewayActor only: the process should end (exit code 0), after this handler.
  virtual void RequestStop() = 0;
  virtual SystemStatus GetSystemStatus() const = 0;
  // What the agent's actors did last, and the messages that they failed at (proto/trace.proto).
  virtual proto::TraceReply GetTrace(const proto::TraceRequest& request) const = 0;
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

// What becomes of a message for which the mailbox has no room.
enum class Overflow {
  kReject,       // The send returns kFull.
  kLatestByKey,  // A message takes the place of the waiting one that has its key (kAccepted); others as with kReject.
  kBlock,        // ActorSystem::Post waits for room; actors and the transport, which never wait, are refused.
};

// A mailbox has two lanes. On the control lane comes what the runtime itself, RoleActor and LeaseActor say (IsControl):
// before all waiting data, and without counting towards the bounds below; its own bound is kControlMessagesMax.
struct SpawnOptions {
  Placement placement = Placement::kPool;
  std::size_t messages_max = 4096;  // Waiting in the data lane; at least 1.
  // Waiting messages' bytes, as serialised; of messages from other agents and clients, which have a quarter of it, as
  // they lie in memory. One larger message fits alone.
  std::size_t bytes_max = 64 * 1024 * 1024;
  Overflow overflow = Overflow::kReject;
  // For kLatestByKey: a message's key; with an empty one it replaces nothing. Runs on the sender's thread.
  std::function<std::string(const proto::Message&)> key = nullptr;
  // A handler that takes longer is logged and counted. Nothing interrupts it.
  Duration handler_limit = std::chrono::seconds(1);
};

// Past this the newest control message of the same kind gives way to the next (a peer that comes and goes while a
// handler takes minutes). What was published is taken in any case, one of each topic past the bound.
inline constexpr std::size_t kControlMessagesMax = 256;

// PeerEvent, RolesChanged, Down, Ping, StepDown, LeasesChanged. None of them is taken from peers or clients.
bool IsControl(const proto::Message& message);
// Its body is that of a Topic.
bool IsOfTopic(const proto::Message& message);

}  // namespace moondb
