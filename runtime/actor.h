// Actor and Context: the complete interface between an actor and the runtime.
//
// An actor handles one message at a time, to completion, and never waits for another actor. It opens no socket and
// starts no thread. It gets the time and random numbers only from its Context, so one seed reproduces the run of a
// whole team (runtime/simulation).
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
// Monotonic time since an arbitrary start.
using MonotonicTime = std::chrono::time_point<std::chrono::steady_clock, Duration>;
using TimerId = std::uint64_t;

enum class [[nodiscard]] SendResult{
    kAccepted,     // The message is in the mailbox or the peer's outbox. It is not yet handled or transmitted.
    kFull,         // The mailbox or outbox is full. The message is dropped and counted.
    kNoActor,      // This agent runs no actor with that name.
    kNoPeer,       // The team has no such agent, or the alias is assigned to no agent at present.
    kUnreachable,  // The peer or client is not connected, or the actor failed permanently or ended.
    kTooLong,      // The message exceeds the limit between agents (runtime/transport.h). It is dropped and counted.
};

const char* ToString(SendResult result);

// A topic that one actor publishes and other actors of the same agent watch. The value of an enumerator is the body of
// the messages that are published for the topic.
enum class Topic {
  kRoles = proto::Message::kRolesChanged,    // RoleActor publishes the current role assignment.
  kLeases = proto::Message::kLeasesChanged,  // LeaseActor publishes which agents drive, sleep or have paused sharing.
  kStored = proto::Message::kRecordsStored,  // StorageActor publishes that rows were inserted or pruned.
};

struct SystemStatus;  // Defined in runtime/system_status.h.

// The runtime's interface to one actor. A Context may be used only inside the handler that received it, on the
// handler's thread.
class Context {
 public:
  virtual ~Context() = default;

  virtual const Address& self() const = 0;
  // The actor that sent the current message to this agent. If a client sent the message: {kClients, name of the
  // client's connection}.
  virtual const Address& sender() const = 0;
  virtual MonotonicTime now() const = 0;
  // UTC in nanoseconds since 1970. For timestamps only: the clock may jump.
  virtual std::int64_t utc_now_ns() const = 0;
  virtual std::mt19937_64& rng() = 0;

  // Sends `message`. Never blocks. A message that is not accepted is dropped. Sets hop_sender and destination_id, and
  // sets agent_id if it is 0. If `to` is on another agent, also sets source_actor and destination_actor. A message
  // within an agent has no source_actor; its receiver calls sender().
  [[nodiscard]] virtual SendResult Send(const Address& to, OwnedMessage message) = 0;

  // Sends to sender(), with the request_id of the message being handled.
  [[nodiscard]] virtual SendResult Reply(OwnedMessage message) = 0;

  // Sends `message` to this actor itself after `delay`, regardless of the mailbox limits. The timer is dropped when
  // this incarnation of the actor ends. Returns an id for Cancel.
  virtual TimerId After(Duration delay, proto::Message message) = 0;
  virtual void Cancel(TimerId timer) = 0;  // Cancelling a timer that already fired has no effect.

  // Starts a timer whose message is Timer{kind, value}.
  TimerId AfterTimer(Duration delay, std::uint32_t kind, std::uint64_t value = 0);

  // Reports that this actor cannot continue. After the handler, the runtime destroys the actor and restarts it through
  // its factory, with a new OnStart. If the error is kCorrupt, there is no restart, and the process ends.
  virtual void Fail(Error error) = 0;

  // Subscribes to PeerEvents. They arrive on the control lane: first one event for each connected peer, then one for
  // each change.
  virtual void WatchPeers() = 0;

  // Subscribes to `topic` until this incarnation ends. For kRoles and kLeases, the last published message, if there is
  // one, arrives first, and then each change; these messages use the control lane. Messages of kStored use the data
  // lane but do not count towards its limits: later ones are merged into one that already waits. Rows that were stored
  // before this call are not reported; read them in OnStart.
  virtual void Watch(Topic topic) = 0;
  // Publishes `message` to the actors that watch its topic. Only RoleActor, LeaseActor and StorageActor may call this,
  // each for its own topic.
  virtual void Publish(OwnedMessage message) = 0;

  // Requests a Down message, on the control lane, each time `target` is lost. `target` is one of:
  //   - an actor of this agent: lost when its incarnation ends (the next incarnation has the same address);
  //   - another agent, with or without an actor's name: lost when its connection breaks. The failure of a remote actor
  //     is not reported.
  // If the actor does not exist or the agent is not connected, the Down is sent immediately. Aliases are resolved
  // during this call. The subscription ends with this incarnation or with Demonitor.
  virtual void Monitor(const Address& target) = 0;
  virtual void Demonitor(const Address& target) = 0;

  // True while the system is stopping. Handlers that run for a long time must poll this.
  virtual bool stop_requested() const = 0;

  // Sets the agents that the aliases resolve to. Only RoleActor may call this.
  virtual void SetRoles(const proto::RoleAssignment& roles) = 0;
  // Requests that the process end with exit code 0 after this handler. Only GatewayActor may call this.
  virtual void RequestStop() = 0;
  virtual SystemStatus GetSystemStatus() const = 0;
  // Returns the latest events of this agent's actors and its dead letters (proto/trace.proto).
  virtual proto::TraceReply GetTrace(const proto::TraceRequest& request) const = 0;
};

class Actor {
 public:
  virtual ~Actor() = default;
  // Loads the actor's state. Called once on each new object, also after a restart.
  virtual void OnStart(Context&) {}
  virtual void OnMessage(Context&, const proto::Message& message) = 0;
};

using ActorFactory = std::function<std::unique_ptr<Actor>()>;

enum class Placement {
  kPool,        // For actors with short handlers.
  kOwnThread,   // For handlers that run long or must stay on one thread (fsync, EGL, a solver).
  kBackground,  // As kOwnThread, but other threads have priority (nice 10). For long work that nobody waits for.
};

// How a full mailbox treats a new message.
enum class Overflow {
  kReject,  // The new message is refused: its send returns kFull.
  // A new message replaces the waiting message with the same key, if there is one, even if the mailbox is not full. The
  // new message is refused if the mailbox would then exceed a limit.
  kLatestByKey,
  kBlock,  // ActorSystem::Post waits for room. Actors and the transport never wait: their sends return kFull.
};

// Placement and mailbox of an actor. A mailbox has two lanes. Messages of the runtime, of RoleActor and of LeaseActor
// (IsControl) wait on the control lane. They are handled before all waiting data messages, and only kControlMessagesMax
// limits their number. All other messages wait on the data lane.
struct SpawnOptions {
  Placement placement = Placement::kPool;
  std::size_t messages_max = 4096;  // Limit of messages waiting on the data lane. At least 1.
  // Limit of serialised bytes waiting on the data lane. Messages above 4096 bytes from other agents and clients count
  // with their size in memory. Messages from other agents and clients with keys are refused if a quarter of the bytes,
  // or three quarters of messages_max, would be exceeded. A message of any size is accepted if no other message waits.
  std::size_t bytes_max = 64 * 1024 * 1024;
  Overflow overflow = Overflow::kReject;
  // Returns a message's key for kLatestByKey. A message with an empty key replaces no other. Called on the sender's
  // thread.
  std::function<std::string(const proto::Message&)> key = nullptr;
  // A handler that takes longer than this is logged and counted. It is not interrupted.
  Duration handler_limit = std::chrono::seconds(1);
};

// Limit of messages waiting on the control lane. At the limit, a new message replaces the newest waiting message with
// the same body; if there is none, the new message is refused. Published messages are accepted above the limit, one of
// each topic. The limit is reached, for example, if a peer reconnects repeatedly while a handler runs for minutes.
inline constexpr std::size_t kControlMessagesMax = 256;

// True for PeerEvent, RolesChanged, Down, Ping, StepDown and LeasesChanged. Messages from peers and clients cannot be
// any of these.
bool IsControl(const proto::Message& message);
// True if `message` can be published for a Topic.
bool IsOfTopic(const proto::Message& message);

}  // namespace moondb
