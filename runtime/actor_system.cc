#include "runtime/actor_system.h"

#include <spdlog/spdlog.h>

#include <atomic>
#include <cstdlib>
#include <mutex>
#include <random>
#include <unordered_map>
#include <utility>
#include <vector>

#include "model/check.h"
#include "runtime/actor_cell.h"
#include "runtime/address_book.h"
#include "runtime/dead_letters.h"
#include "runtime/envelope.h"
#include "runtime/monitors.h"
#include "runtime/role_table.h"
#include "runtime/system_status.h"

namespace moondb {
namespace {

std::uint64_t SeedOf(std::uint64_t seed) {
  if (seed != 0) return seed;
  std::random_device entropy;
  return std::uint64_t{entropy()} << 32 | entropy();
}

// The actor that this thread found last. Most threads send to the same actor repeatedly.
struct LastFound {
  std::uint64_t system_number = 0;  // 0: nothing is cached.
  ActorCell* cell = nullptr;
};
thread_local LastFound last_found;

std::atomic<std::uint64_t> system_count = 0;

}  // namespace

class ActorSystem::Impl final : public CellSystem {
 public:
  explicit Impl(Options options);
  ~Impl() override { Stop(); }

  void Spawn(std::string name, SpawnOptions options, ActorFactory factory);
  void Start(Transport* transport);
  SendResult Post(const std::string& actor, OwnedMessage message);
  SendResult Deliver(OwnedMessage message);
  void OnPeerChanged(AgentId peer, bool is_connected);
  void Stop();
  proto::TraceReply Trace(const proto::TraceRequest& request) const override;
  const TraceBook& trace_book() const { return trace_; }

 private:
  // Implementation of CellSystem.
  TimerThread& timers() override { return timers_; }
  TraceBook& trace() override { return trace_; }
  SendResult SendFrom(ActorCell& sender, const Address& to, OwnedMessage message) override;
  void SetRoles(const proto::RoleAssignment& roles) override { roles_.SetRoles(roles); }
  void WatchPeers(const std::string& watcher) override;
  void Watch(const std::string& watcher, Topic topic) override;
  void Publish(const std::string& publisher, const proto::Message& message) override;
  void Monitor(const std::string& watcher, const Address& target) override;
  void Demonitor(const std::string& watcher, const Address& target) override;
  SystemStatus Status() const override;
  void OnStopRequested() override;
  void OnFailed(const ActorCell& cell, Mailbox::Item* item, const Error& error, bool is_final) override;
  void OnStepDown(const Address& actor, const Error& error) override;
  void OnBeyondHelp(const Address& actor, const Error& error) override;

  ActorCell* Find(const std::string& actor) const;
  ActorCell* FindFromOutside(const std::string& actor) const;  // Called on threads that run no actor.
  const Address* TakeSender(proto::Message& message);
  SendResult SendAway(const Address& from, const Address& to, proto::Message& message);
  void Notify(Monitors::Notices notices);
  void TraceRefused(TraceRecord record, SendResult result);
  void ScheduleHealthCheck();
  void CheckHealth();

  const Options options_;
  const std::uint64_t system_number_ = ++system_count;  // Unique in this process, from 1.
  const Address outside_;
  const std::uint64_t seed_;
  RoleTable roles_;
  AddressBook remote_senders_;
  TraceBook trace_;
  std::atomic<Transport*> transport_ = nullptr;
  std::atomic<bool> is_fatal_ = false;
  const MonotonicTime created_ = std::chrono::steady_clock::now();
  std::mutex stop_mutex_;
  bool was_started_ = false;

  // Held while notices are delivered, so that they arrive in the order of their events. Acquired before a cell's mutex.
  std::mutex monitors_mutex_;
  Monitors monitors_;
  mutable std::mutex dead_letters_mutex_;
  DeadLetters dead_letters_;

  // The order of the following members matters: threads are destroyed before the members that they use.
  std::vector<std::unique_ptr<ActorCell>> cells_;  // In the order of spawning. Not changed after Start.
  std::unordered_map<std::string, ActorCell*> cell_of_;
  // On a separate cache line, because each submission writes to it and each send reads the members above.
  alignas(64) WorkerPool pool_;
  TimerThread timers_;
};

ActorSystem::Impl::Impl(Options options)
    : options_(std::move(options)),
      outside_{options_.self, "outside"},
      seed_(SeedOf(options_.seed)),
      roles_(options_.base_station),
      trace_(options_.self, TickClock::NanosecondsPerTick()),
      monitors_(options_.self),
      pool_("workers", options_.worker_count, [this] { trace_.JoinThread(); }) {
  Check(options_.self >= 1 && options_.self <= kAgentIdMax, "an agent's id is from 1 to 65535");
}

// --- Calls from outside the actors ---

void ActorSystem::Impl::Spawn(std::string name, SpawnOptions options, ActorFactory factory) {
  Check(!was_started_, "actors are spawned before Start");
  Check(!cell_of_.contains(name), "names of actors are unique");
  Supervisor::Options supervision;
  supervision.restarts_max = options_.restarts_max;
  supervision.restart_period = options_.restart_period;
  // StepDown needs a RoleActor, and a failing RoleActor cannot step down itself.
  supervision.can_step_down = cell_of_.contains(actor_name::kRole) && name != actor_name::kRole;
  cells_.push_back(std::make_unique<ActorCell>(*this, Address{options_.self, name}, std::move(options),
                                               std::move(factory), pool_, supervision, seed_));
  cell_of_.emplace(std::move(name), cells_.back().get());
}

void ActorSystem::Impl::Start(Transport* transport) {
  Check(!std::exchange(was_started_, true), "a system is started once");
  transport_ = transport;
  for (const auto& cell : cells_) {
    if (is_stopping_) return;
    cell->BeginStart();
    cell->WaitUntilStarted();
  }
  is_started_ = true;
  for (const auto& cell : cells_) cell->Wake();
  ScheduleHealthCheck();
}

SendResult ActorSystem::Impl::Post(const std::string& actor, OwnedMessage message) {
  ActorCell* cell = FindFromOutside(actor);
  if (cell == nullptr) return SendResult::kNoActor;
  WriteLocalEnvelope(options_.self, options_.self, *message);
  return cell->Push(std::move(message), &outside_, TraceRecord::kNobody, /*may_wait=*/true);
}

SendResult ActorSystem::Impl::Deliver(OwnedMessage message) {
  TraceRecord record;
  record.other_agent = message->hop_sender();
  record.body = static_cast<std::uint16_t>(message->body_case());
  record.request_id = message->request_id();
  ActorCell* cell = FindFromOutside(message->destination_actor());
  SendResult result = SendResult::kNoActor;
  if (cell != nullptr) {
    record.actor = cell->trace_name();
    const Address* sender = TakeSender(*message);
    result = cell->PushFromOutside(std::move(message), sender);
  }
  if (result != SendResult::kAccepted) {
    record.time = TickClock::Now();
    TraceRefused(record, result);
  }
  return result;
}

// Removes the sender's name from `message` and returns the sender's address, which remote_senders_ owns. Returns null
// if the name stays in `message`. Frees the names here, on the thread that allocated them, and not on the actor's
// thread.
const Address* ActorSystem::Impl::TakeSender(proto::Message& message) {
  delete message.release_destination_actor();            // Clearing the string would keep its memory.
  if (message.hop_sender() == kClients) return nullptr;  // Clients reconnect too often to store their addresses.
  const Address* sender = remote_senders_.Keep(SenderOf(message));
  if (sender != nullptr) delete message.release_source_actor();
  return sender;
}

void ActorSystem::Impl::OnPeerChanged(AgentId peer, bool is_connected) {
  const std::lock_guard lock(monitors_mutex_);
  Notify(monitors_.OnPeerChanged(peer, is_connected));
}

void ActorSystem::Impl::Stop() {
  is_stopping_ = true;
  const std::lock_guard lock(stop_mutex_);
  timers_.Join();
  for (auto cell = cells_.rbegin(); cell != cells_.rend(); ++cell) (*cell)->EndAndWait();
  for (const auto& cell : cells_) cell->Join();
  pool_.Join();
}

ActorCell* ActorSystem::Impl::Find(const std::string& actor) const {
  const auto found = cell_of_.find(actor);
  return found == cell_of_.end() ? nullptr : found->second;
}

ActorCell* ActorSystem::Impl::FindFromOutside(const std::string& actor) const {
  if (last_found.system_number != system_number_ || last_found.cell->self().actor != actor) {
    ActorCell* cell = Find(actor);
    if (cell == nullptr) return nullptr;
    last_found = {system_number_, cell};
  }
  return last_found.cell;
}

// --- Calls from actors ---

SendResult ActorSystem::Impl::SendFrom(ActorCell& sender, const Address& to, OwnedMessage message) {
  TraceRecord record;
  record.time = sender.handler_begun();
  record.actor = sender.trace_name();
  record.body = static_cast<std::uint16_t>(message->body_case());
  record.request_id = message->request_id();
  record.other_agent = roles_.Resolve(to.agent);
  ActorCell* cell = sender.LastTarget(to.actor);
  if (cell == nullptr) {
    // If the target is on another agent, find this agent's actor with the same name. The trace then shows the name of
    // that actor for the target.
    cell = Find(to.actor);
    sender.RememberTarget(cell);
  }
  if (cell != nullptr) record.other_actor = cell->trace_name();
  SendResult result = SendResult::kNoActor;
  if (record.other_agent != options_.self) {
    result = SendAway(sender.self(), {record.other_agent, to.actor}, *message);
  } else if (cell != nullptr) {
    WriteLocalEnvelope(options_.self, options_.self, *message);
    result = cell->Push(std::move(message), &sender.self(), sender.trace_name());
  }
  if (result != SendResult::kAccepted) {
    TraceRefused(record, result);
  } else {
    trace_.Add(record);
  }
  return result;
}

SendResult ActorSystem::Impl::SendAway(const Address& from, const Address& to, proto::Message& message) {
  if (to.agent == 0) return SendResult::kNoPeer;
  Transport* transport = transport_;
  if (transport == nullptr) return to.agent == kClients ? SendResult::kUnreachable : SendResult::kNoPeer;
  WriteEnvelope(from, to, message);
  return transport->Send(to, message);
}

void ActorSystem::Impl::TraceRefused(TraceRecord record, SendResult result) {
  record.kind = proto::TRACE_REFUSED;
  record.result = result;
  trace_.Add(record);
}

void ActorSystem::Impl::WatchPeers(const std::string& watcher) {
  const std::lock_guard lock(monitors_mutex_);
  Notify(monitors_.WatchPeers(watcher));
}

void ActorSystem::Impl::Watch(const std::string& watcher, Topic topic) {
  const std::lock_guard lock(monitors_mutex_);
  Notify(monitors_.Watch(watcher, topic));
}

void ActorSystem::Impl::Publish(const std::string& publisher, const proto::Message& message) {
  const std::lock_guard lock(monitors_mutex_);
  Notify(monitors_.Publish(publisher, message));
}

void ActorSystem::Impl::Monitor(const std::string& watcher, const Address& target) {
  const Address resolved{roles_.Resolve(target.agent), target.actor};
  const ActorCell* cell = Find(target.actor);
  const std::lock_guard lock(monitors_mutex_);
  Notify(monitors_.Monitor(watcher, resolved, cell == nullptr || cell->is_lost()));
}

void ActorSystem::Impl::Demonitor(const std::string& watcher, const Address& target) {
  const std::lock_guard lock(monitors_mutex_);
  monitors_.Demonitor(watcher, {roles_.Resolve(target.agent), target.actor});
}

void ActorSystem::Impl::Notify(Monitors::Notices notices) {
  for (Monitors::Notice& notice : notices) {
    ActorCell* cell = Find(notice.watcher);
    if (cell != nullptr) (void)cell->Push(std::move(notice.message), nullptr, TraceRecord::kNobody);
  }
}

SystemStatus ActorSystem::Impl::Status() const {
  SystemStatus status;
  status.uptime = std::chrono::steady_clock::now() - created_;
  for (const auto& cell : cells_) status.actors.push_back(cell->Status());
  if (const Transport* transport = transport_) status.peers = transport->Peers();
  return status;
}

proto::TraceReply ActorSystem::Impl::Trace(const proto::TraceRequest& request) const {
  proto::TraceReply reply;
  trace_.Report(request, TickClock::Now(), &reply);
  const std::lock_guard lock(dead_letters_mutex_);
  dead_letters_.Report(request, std::chrono::steady_clock::now(), &reply);
  return reply;
}

void ActorSystem::Impl::OnStopRequested() {
  if (options_.on_stop_requested) options_.on_stop_requested();
}

// --- Supervision ---

void ActorSystem::Impl::OnFailed(const ActorCell& cell, Mailbox::Item* item, const Error& error, bool is_final) {
  {
    const std::lock_guard lock(dead_letters_mutex_);
    dead_letters_.Add(std::chrono::steady_clock::now(), cell.self().actor, item, error);
  }
  const std::lock_guard lock(monitors_mutex_);
  Notify(monitors_.OnActorDown(cell.self().actor, ToString(error), is_final));
}

void ActorSystem::Impl::OnStepDown(const Address& actor, const Error& error) {
  spdlog::error("actor {} fails again and again, the agent gives up its role: {}", ToString(actor), ToString(error));
  ActorCell* role = Find(actor_name::kRole);
  if (role == nullptr) return;
  OwnedMessage message;
  message->mutable_step_down()->set_actor(actor.actor);
  message->mutable_step_down()->set_reason(ToString(error));
  WriteLocalEnvelope(options_.self, options_.self, *message);
  (void)role->Push(std::move(message), &outside_, TraceRecord::kNobody);
}

void ActorSystem::Impl::OnBeyondHelp(const Address& actor, const Error& error) {
  if (is_fatal_.exchange(true)) return;
  const Error fatal{error.code, "actor " + ToString(actor) + " has failed permanently: " + ToString(error), {}};
  spdlog::critical("{}", ToString(fatal));
  if (!options_.on_fatal) std::abort();
  options_.on_fatal(fatal);
}

// --- Watchdog ---

void ActorSystem::Impl::ScheduleHealthCheck() {
  timers_.Add(std::chrono::steady_clock::now() + options_.health_period, [this] { CheckHealth(); });
}

void ActorSystem::Impl::CheckHealth() {
  for (const auto& cell : cells_) {
    const Duration handler_time = cell->HandlerTime();
    if (handler_time > cell->options().handler_limit) {
      spdlog::warn("actor {} has been in one handler for {:.1f} s", ToString(cell->self()),
                   std::chrono::duration<double>(handler_time).count());
    }
    if (cell->PingTime() > options_.stuck_after) {
      OnBeyondHelp(cell->self(), {ErrorCode::kTimedOut, "it did not answer the watchdog in time", {}});
    }
    cell->Ping();
  }
  if (options_.on_healthy && !is_fatal_) options_.on_healthy();
  ScheduleHealthCheck();
}

// --- ActorSystem ---

ActorSystem::ActorSystem(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
ActorSystem::~ActorSystem() = default;

void ActorSystem::Spawn(std::string name, SpawnOptions options, ActorFactory factory) {
  impl_->Spawn(std::move(name), std::move(options), std::move(factory));
}
void ActorSystem::Start(Transport* transport) { impl_->Start(transport); }
SendResult ActorSystem::Deliver(OwnedMessage message) { return impl_->Deliver(std::move(message)); }
void ActorSystem::OnPeerChanged(AgentId peer, bool is_connected) { impl_->OnPeerChanged(peer, is_connected); }
SendResult ActorSystem::Post(const std::string& actor, OwnedMessage message) {
  return impl_->Post(actor, std::move(message));
}
void ActorSystem::Stop() { impl_->Stop(); }
proto::TraceReply ActorSystem::Trace(const proto::TraceRequest& request) const { return impl_->Trace(request); }
const TraceBook& ActorSystem::trace_book() const { return impl_->trace_book(); }

}  // namespace moondb
