// ActorCell: one actor of an ActorSystem, with its ActorHost, mailbox, worker pool and supervisor.
//
// In one turn, a thread of the pool handles some of the waiting messages. At most one turn of a cell is submitted to
// its pool at any time, so one thread at a time reads the mailbox and uses the ActorHost. Successive turns may run on
// different threads; the mailbox's lock orders their memory accesses.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "runtime/actor_host.h"
#include "runtime/handler_times.h"
#include "runtime/mailbox.h"
#include "runtime/supervisor.h"
#include "runtime/timer_thread.h"
#include "runtime/trace_book.h"
#include "runtime/worker_pool.h"

namespace moondb::proto {
class ActorStatus;
}  // namespace moondb::proto

namespace moondb {

class ActorCell;

// The part of ActorSystem that all its cells use. Virtual functions are called on the actor's thread.
class CellSystem {
 public:
  virtual ~CellSystem() = default;
  // True while the system handles messages: all actors are started and Stop was not called.
  bool is_flowing() const { return is_started_ && !is_stopping_; }
  bool is_stopping() const { return is_stopping_; }

  virtual TimerThread& timers() = 0;
  virtual TraceBook& trace() = 0;
  virtual SendResult SendFrom(ActorCell& sender, const Address& to, OwnedMessage message) = 0;
  virtual void SetRoles(const proto::RoleAssignment& roles) = 0;
  virtual void WatchPeers(const std::string& watcher) = 0;
  virtual void Watch(const std::string& watcher, Topic topic) = 0;
  virtual void Publish(const std::string& publisher, const proto::Message& message) = 0;
  virtual void Monitor(const std::string& watcher, const Address& target) = 0;
  virtual void Demonitor(const std::string& watcher, const Address& target) = 0;
  virtual SystemStatus Status() const = 0;
  virtual proto::TraceReply Trace(const proto::TraceRequest& request) const = 0;
  virtual void OnStopRequested() = 0;

  // Called after the actor failed and its incarnation ended. `item` holds the message whose handler failed; null if
  // OnStart failed. `is_final`: the actor will not restart.
  virtual void OnFailed(const ActorCell& cell, Mailbox::Item* item, const Error& error, bool is_final) = 0;
  virtual void OnStepDown(const Address& actor, const Error& error) = 0;
  virtual void OnBeyondHelp(const Address& actor, const Error& error) = 0;

 protected:
  std::atomic<bool> is_started_ = false;
  std::atomic<bool> is_stopping_ = false;
};

class ActorCell final : public ActorHost, private Runnable {
 public:
  // `pool` runs actors with Placement::kPool. Requires: `pool` and `system` outlive the cell.
  ActorCell(CellSystem& system, Address self, SpawnOptions options, ActorFactory factory, WorkerPool& pool,
            Supervisor::Options supervision, std::uint64_t seed);

  // Puts a message into the mailbox. Thread-safe. Returns the result of Mailbox::Push, for example kUnreachable if
  // the actor failed permanently or ended.
  // `sender` and `sender_name`: see Mailbox::Item. If `may_wait`, waits without a time limit for room in a full kBlock
  // mailbox.
  SendResult Push(OwnedMessage message, const Address* sender, std::uint16_t sender_name, bool may_wait = false);
  // Pushes a message from another agent or a client, with the results of Push. Null `sender`: the sender is in the
  // message's envelope.
  SendResult PushFromOutside(OwnedMessage message, const Address* sender);
  void Wake();
  void BeginStart();
  void WaitUntilStarted();  // Also returns if the actor failed permanently or ended.
  void EndAndWait();        // Destroys the actor on its own thread.
  void Join();              // Joins the actor's own thread, if it has one.
  proto::ActorStatus Status() const;
  bool is_lost() const;  // True if the actor failed permanently or ended.
  std::uint16_t trace_name() const { return trace_name_; }

  // For the watchdog, which calls these three functions on one thread. HandlerTime returns how long the current handler
  // has been running, or zero if none runs. PingTime returns how long a Ping has been waiting in the mailbox, or zero
  // if none waits. Ping sends a Ping if the actor has work and no earlier Ping waits.
  Duration HandlerTime() const;
  Duration PingTime() const;
  void Ping();
  const SpawnOptions& options() const { return options_; }

  // Implementation of Context.
  MonotonicTime now() const override { return std::chrono::steady_clock::now(); }
  std::int64_t utc_now_ns() const override;
  SendResult Send(const Address& to, OwnedMessage message) override {
    return system_.SendFrom(*this, to, std::move(message));
  }
  TimerId After(Duration delay, proto::Message message) override;
  void Cancel(TimerId timer) override { system_.timers().Cancel(timer); }
  void WatchPeers() override { system_.WatchPeers(self().actor); }
  void Watch(Topic topic) override { system_.Watch(self().actor, topic); }
  void Publish(OwnedMessage message) override { system_.Publish(self().actor, *message); }
  void Monitor(const Address& target) override { system_.Monitor(self().actor, target); }
  void Demonitor(const Address& target) override { system_.Demonitor(self().actor, target); }
  bool stop_requested() const override { return system_.is_stopping(); }
  void SetRoles(const proto::RoleAssignment& roles) override { system_.SetRoles(roles); }
  SystemStatus GetSystemStatus() const override;
  proto::TraceReply GetTrace(const proto::TraceRequest& request) const override { return system_.Trace(request); }

  // Returns the target of this actor's last send if that target is named `actor`, otherwise null. A cache: most actors
  // send to the same target repeatedly. Call on the actor's thread only.
  ActorCell* LastTarget(const std::string& actor) const {
    return last_target_ != nullptr && last_target_->self().actor == actor ? last_target_ : nullptr;
  }
  void RememberTarget(ActorCell* target) { last_target_ = target; }
  // Start time of the current handler. Call inside a handler only, on the actor's thread.
  Ticks handler_begun() const { return times_.begun(); }

 private:
  enum class State { kAway, kReady, kBeyondHelp, kEnded };

  static bool IsFinal(State state) { return state == State::kBeyondHelp || state == State::kEnded; }
  SendResult Settle(Mailbox::Pushed pushed);  // Submits a turn if pushed.must_call_reader. Returns pushed.result.
  SendResult PushWaiting(Mailbox::Item item);

  // The functions from here on are called on the actor's thread.
  Ticks RunTurn(Ticks now) override;
  bool EndIfDue();
  Ticks StartIfDue(Ticks now);
  Ticks HandleItem(Mailbox::Item& item, Ticks now);
  void TraceHandler(const Mailbox::Item& item, Ticks took);
  void LetWaitersTry();
  // Called after each handler. `item` holds the handled message; null after OnStart. `failure` is the handler's error,
  // if it failed.
  void SettleHandler(Mailbox::Item* item, const std::optional<Error>& failure);
  void Recover(Mailbox::Item* item, const Error& failure);
  TraceRecord MakeRecord(proto::TraceKind kind, Ticks time) const;
  void EnterState(State state);

  // The actor's thread writes these members for each message. Other threads may read their atomics.
  HandlerTimes times_;
  PingTimes pings_;
  ActorCell* last_target_ = nullptr;

  // Members that senders read. They are on another cache line than the members that are written for each message.
  alignas(64) CellSystem& system_;
  const std::unique_ptr<WorkerPool> own_pool_;  // A pool of one thread; null for kPool.
  WorkerPool& pool_;
  const std::uint16_t trace_name_;
  const bool may_senders_wait_;
  std::atomic<bool> is_order_waiting_ = false;  // True if is_start_due_ or is_end_due_ is set.
  State state_ = State::kAway;  // Written on the actor's thread under mutex_; that thread reads it without the lock.

  Mailbox mailbox_;

  const SpawnOptions options_;
  Supervisor supervisor_;  // Used on the actor's thread only.

  mutable std::mutex mutex_;
  std::condition_variable state_changed_;
  std::condition_variable has_room_;
  bool is_start_due_ = false;
  bool is_end_due_ = false;
  std::uint64_t restarts_ = 0;
  std::atomic<int> waiters_ = 0;  // Number of senders that wait for room.
};

}  // namespace moondb
