// Actor and Context: the complete interface between an actor and the runtime.
//
// An actor handles one message at a time, to completion, and never blocks on another actor. It reads no clock, opens no
// socket, starts no thread and draws no random number by itself. The Context provides all of these, so one seed
// reproduces the run of a whole team (runtime/simulation).
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
    kUnreachable,  // The peer or client is not connected.
    kTooLong,      // The message exceeds the limit between agents (runtime/transport.h). It is dropped and counted.
};

const char* ToString(SendResult result);

// A topic that one actor publishes and any other actor of the same agent can watch. Each value is the message body that
// Publish accepts for the topic.
enum class Topic {
  kRoles = proto::Message::kRolesChanged,    // RoleActor publishes the current role assignment.
  kLeases = proto::Message::kLeasesChanged,  // LeaseActor publishes which agents drive, sleep or are paused.
  kStored = proto::Message::kRecordsStored,  // StorageActor publishes that rows were inserted or pruned.
};

struct SystemStatus;  // runtime/system_status.h

// The runtime as one actor sees it. Valid only inside the handler that received it, on the thread of that handler.
class Context {
 public:
  virtual ~Context() = default;

  virtual const Address& self() const = 0;
  // The sender of the current message: its source actor on the agent that sent the last hop. For a client, {kClients,
  // name of its connection}.
  virtual const Address& sender() const = 0;
  virtual MonotonicTime now() const = 0;
  // UTC in nanoseconds since 1970. For timestamps only: the clock may jump.
  virtual std::int64_t utc_now_ns() const = 0;
  virtual std::mt19937_64& rng() = 0;

  // Sends `message`, which may also be a moved proto::Message. Never blocks. A message that is not accepted is dropped.
  // Sets hop_sender and destination_id, and agent_id if it is 0. For another agent, also sets source_actor and
  // destination_actor. A message within an agent does not carry these two names: the receiver calls sender().
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

  // Subscribes to PeerEvents on the control lane: first one event for each connected peer, then one for each change.
  virtual void WatchPeers() = 0;

  // Subscribes to `topic` until this incarnation ends. Roles and leases arrive on the control lane: first the last
  // published message, if there is one, then each change. Topic::kStored arrives on the data lane, regardless of the
  // lane's limits: while one such message waits, later ones are merged into it. Rows that were stored before this call
  // are not reported; read them in OnStart.
  virtual void Watch(Topic topic) = 0;
  // Publishes `message` to the watchers of its topic. Only RoleActor, LeaseActor and StorageActor may call this, each
  // for its own topic.
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
  // The latest events of this agent's actors, and its dead letters (proto/trace.proto).
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
  kPool,       // For actors with short handlers.
  kOwnThread,  // For handlers that run long or must stay on one thread (fsync, EGL, a solver).
};

// How a full mailbox treats a new message.
enum class Overflow {
  kReject,       // The message is refused: its send returns kFull.
  kLatestByKey,  // Replaces the waiting message that has the same key. If no message has it: as kReject.
  kBlock,        // ActorSystem::Post waits for room. Actors and the transport never wait: their sends return kFull.
};

// Options of an actor's placement and mailbox. A mailbox has two lanes. The control lane holds messages of the runtime,
// RoleActor and LeaseActor (IsControl). They are handled before all waiting data and do not count towards the limits
// below. The limit of the control lane is kControlMessagesMax.
struct SpawnOptions {
  Placement placement = Placement::kPool;
  std::size_t messages_max = 4096;  // Limit of messages waiting on the data lane. At least 1.
  // Limit of waiting bytes, as serialised. Messages from other agents and clients count with their size in memory and
  // may use a quarter of the limit. A message larger than the limit is accepted if no other message waits.
  std::size_t bytes_max = 64 * 1024 * 1024;
  Overflow overflow = Overflow::kReject;
  // Returns a message's key, for kLatestByKey. A message with an empty key replaces nothing. Runs on the sender's
  // thread.
  std::function<std::string(const proto::Message&)> key = nullptr;
  // A handler that takes longer than this is logged and counted. It is not interrupted.
  Duration handler_limit = std::chrono::seconds(1);
};

// Limit of messages waiting on the control lane. At the limit, a new message replaces the newest waiting message of the
// same kind; if there is none, the new message is refused. Published messages are accepted above the limit, one of each
// topic. The limit is reached, for example, if a peer reconnects repeatedly while a handler runs for minutes.
inline constexpr std::size_t kControlMessagesMax = 256;

// True for PeerEvent, RolesChanged, Down, Ping, StepDown and LeasesChanged. Messages from peers and clients cannot be
// any of these.
bool IsControl(const proto::Message& message);
// True if the body of `message` is the value of a Topic.
bool IsOfTopic(const proto::Message& message);

}  // namespace moondb
