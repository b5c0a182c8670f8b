// ActorCell: one actor of an ActorSystem: its ActorHost, its mailbox, its place to run, its supervisor.
//
// At most one turn of it is submitted at any time, the mailbox's reader, so that the ActorHost part is used by one
// thread at a time; the mailbox hands the actor from thread to thread. What the cells of a system share comes from
// CellSystem.
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

// What a cell needs of its system. What is virtual is called on the actor's thread.
class CellSystem {
 public:
  virtual ~CellSystem() = default;
  // Messages are handled: all actors are started, and none is to end yet.
  bool is_flowing() const { return is_started_ && !is_stopping_; }
  bool is_stopping() const { return is_stopping_; }  // No further message is handled.

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

  // The actor failed; its incarnation is gone. `item` is what it failed at, to keep; null in OnStart.
  virtual void OnFailed(const ActorCell& cell, Mailbox::Item* item, const Error& error, bool is_final) = 0;
  virtual void OnStepDown(const Address& actor, const Error& error) = 0;
  virtual void OnBeyondHelp(const Address& actor, const Error& error) = 0;

 protected:
  std::atomic<bool> is_started_ = false;
  std::atomic<bool> is_stopping_ = false;
};

class ActorCell final : public ActorHost, private Runnable {
 public:
  // `pool` serves Placement::kPool; it, like `system`, outlives the cell.
  ActorCell(CellSystem& system, Address self, SpawnOptions options, ActorFactory factory, WorkerPool& pool,
            Supervisor::Options supervision, std::uint64_t seed);

  // Any thread. kUnreachable where the actor is beyond help or ended. `sender` and `sender_name`: see Mailbox::Item.
  // `may_wait`: for room in a full kBlock mailbox, as long as it takes.
  SendResult Push(OwnedMessage message, const Address* sender, std::uint16_t sender_name, bool may_wait = false);
  // From another agent or a client.
  SendResult PushFromOutside(OwnedMessage message, const Address* sender);
  void Wake();
  void BeginStart();
  void WaitUntilStarted();  // Or beyond help, or ended.
  void EndAndWait();        // Destroys the actor where it runs.
  void Join();              // Its own thread.
  proto::ActorStatus Status() const;
  bool is_lost() const;  // Beyond help or ended.
  std::uint16_t trace_name() const { return trace_name_; }

  // For the watchdog, from one thread: how long the present handler runs already and the last Ping waits; zero if there
  // is none. Ping asks whether the actor gets its turn, if it has work and no earlier Ping waits.
  Duration HandlerTime() const;
  Duration PingTime() const;
  void Ping();
  const SpawnOptions& options() const { return options_; }

  // Context.
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

  // The actor's thread: the actor of that name if it was remembered last; null: not that one. Mostly an actor sends
  // where it sent before.
  ActorCell* LastTarget(const std::string& actor) const {
    return last_target_ != nullptr && last_target_->self().actor == actor ? last_target_ : nullptr;
  }
  void RememberTarget(ActorCell* target) { last_target_ = target; }
  // The actor's thread, in a handler: when it began.
  Ticks handler_begun() const { return times_.begun(); }

 private:
  enum class State { kAway, kReady, kBeyondHelp, kEnded };

  static bool IsFinal(State state) { return state == State::kBeyondHelp || state == State::kEnded; }
  SendResult Settle(Mailbox::Pushed pushed);  // Submits a turn if the reader is to be called.
  SendResult PushWaiting(Mailbox::Item item);

  // The actor's thread.
  Ticks RunTurn(Ticks now) override;
  bool EndIfDue();
  Ticks StartIfDue(Ticks now);
  Ticks HandleItem(Mailbox::Item& item, Ticks now);
  void TraceHandler(const Mailbox::Item& item, Ticks took);
  void LetWaitersTry();
  // `item` is what was handled; null in OnStart.
  void SettleHandler(Mailbox::Item* item, const std::optional<Error>& failure);
  void Recover(Mailbox::Item* item, const Error& failure);
  TraceRecord MakeRecord(proto::TraceKind kind, Ticks time) const;
  void EnterState(State state);

  // What each message writes, beside ActorHost's. Written on the actor's thread; the atomics are read on any.
  HandlerTimes times_;
  PingTimes pings_;
  ActorCell* last_target_ = nullptr;

  // What senders read, on another cache line.
  alignas(64) CellSystem& system_;
  const std::unique_ptr<WorkerPool> own_pool_;  // Of one thread, for kOwnThread.
  WorkerPool& pool_;
  const std::uint16_t trace_name_;
  const bool may_senders_wait_;
  std::atomic<bool> is_order_waiting_ = false;  // is_start_due_ or is_end_due_.
  State state_ = State::kAway;                  // Written on the actor's thread with mutex_ held, read there without.

  Mailbox mailbox_;

  const SpawnOptions options_;
  Supervisor supervisor_;  // The actor's thread only.

  mutable std::mutex mutex_;
  std::condition_variable state_changed_;
  std::condition_variable has_room_;
  bool is_start_due_ = false;
  bool is_end_due_ = false;
  std::uint64_t restarts_ = 0;
  std::atomic<int> waiters_ = 0;  // For room.
};

}  // namespace moondb
