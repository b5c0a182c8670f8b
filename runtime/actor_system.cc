#include "runtime/actor_system.h"

#include <spdlog/spdlog.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <map>
#include <mutex>
#include <random>
#include <utility>
#include <vector>

#include "model/check.h"
#include "runtime/actor_host.h"
#include "runtime/envelope.h"
#include "runtime/mailbox.h"
#include "runtime/role_table.h"
#include "runtime/supervisor.h"
#include "runtime/timer_thread.h"
#include "runtime/worker_pool.h"

namespace moondb {
namespace {

// Messages that one actor handles before the others of its pool have their turn.
constexpr int kTurnMessages = 64;
constexpr std::array kToldOfPeers = {actor_name::kRole, actor_name::kSync, actor_name::kReplica};

std::uint64_t SeedOf(std::uint64_t seed) {
  if (seed != 0) return seed;
  std::random_device entropy;
  return std::uint64_t{entropy()} << 32 | entropy();
}

}  // namespace

class ActorSystem::Impl {
 public:
  class Cell;

  explicit Impl(Options options);
  ~Impl() { Stop(); }

  void Spawn(std::string name, SpawnOptions options, ActorFactory factory);
  void Start(Transport* transport);
  SendResult Send(const Address& from, const Address& to, proto::Message message);
  SendResult Deliver(MessagePtr message);
  void OnPeerChanged(AgentId peer, bool is_connected);
  void Stop();
  SystemStatus Status() const;

  // Called on the actor's thread.
  void OnBeyondHelp(const Address& actor, const Error& error);
  void OnStopRequested() {
    if (options_.on_stop_requested) options_.on_stop_requested();
  }

  bool is_flowing() const { return is_flowing_; }
  bool is_stopping() const { return is_stopping_; }
  RoleTable& roles() { return roles_; }
  TimerThread& timers() { return timers_; }
  AgentId agent() const { return options_.self; }

 private:
  Cell* Find(const std::string& actor);

  const Options options_;
  const std::uint64_t seed_;
  RoleTable roles_;
  std::atomic<Transport*> transport_ = nullptr;
  std::atomic<bool> is_flowing_ = false;
  std::atomic<bool> is_stopping_ = false;
  std::atomic<bool> is_fatal_ = false;
  MonotonicTime started_ = std::chrono::steady_clock::now();
  std::mutex stop_mutex_;
  bool is_started_ = false;

  // From here on the order matters: threads end before what they use.
  std::vector<std::unique_ptr<Cell>> cells_;  // Fixed from Start on, in the order of spawning.
  std::map<std::string, Cell*> cell_of_;
  WorkerPool pool_;
  TimerThread timers_;
};

// An actor with its mailbox and its place to run. At most one turn of it is submitted at any time, so that the
// ActorHost part is used by one thread at a time; mutex_ guards the rest, and hands the actor from thread to thread.
class ActorSystem::Impl::Cell final : public ActorHost {
 public:
  Cell(Impl& system, std::string name, const SpawnOptions& options, ActorFactory factory, WorkerPool& pool,
       std::uint64_t seed);

  // Any thread.
  SendResult Push(MessagePtr message);
  void PushSystem(MessagePtr message, std::uint64_t incarnation);
  void Wake();
  void BeginStart();
  void WaitUntilStarted();  // Or beyond help, or ended.
  void EndAndWait();        // Destroys the actor where it runs.
  void Join();              // Its own thread.
  proto::ActorStatus Status() const;

  // Context.
  MonotonicTime now() const override { return std::chrono::steady_clock::now(); }
  std::int64_t utc_now_ns() const override;
  SendResult Send(const Address& to, proto::Message message) override {
    return system_.Send(self(), to, std::move(message));
  }
  TimerId After(Duration delay, proto::Message message) override;
  void Cancel(TimerId timer) override { system_.timers().Cancel(timer); }
  bool stop_requested() const override { return system_.is_stopping(); }
  void SetRoles(const proto::RoleAssignment& roles) override { system_.roles().SetRoles(roles); }
  SystemStatus GetSystemStatus() const override { return system_.Status(); }

 private:
  enum class State { kAway, kReady, kBeyondHelp, kEnded };

  // With mutex_ held.
  bool HasMessageDue() const;
  bool HasWork() const { return state_ != State::kEnded && (is_end_due_ || is_start_due_ || HasMessageDue()); }
  void SubmitIfDue();

  void RunTurn();
  bool RunStep();  // False when there is nothing to do.
  void SettleHandler(const std::optional<Error>& failure);
  void Recover(const Error& failure);
  void EnterState(State state);

  Impl& system_;
  std::unique_ptr<WorkerPool> own_pool_;  // Of one thread, for kOwnThread.
  WorkerPool& pool_;
  Supervisor supervisor_;

  mutable std::mutex mutex_;
  std::condition_variable state_changed_;
  Mailbox mailbox_;
  State state_ = State::kAway;
  bool is_submitted_ = false;
  bool is_start_due_ = false;
  bool is_end_due_ = false;
  std::uint64_t restarts_ = 0;
};

// --- Cell ---

ActorSystem::Impl::Cell::Cell(Impl& system, std::string name, const SpawnOptions& options, ActorFactory factory,
                              WorkerPool& pool, std::uint64_t seed)
    : ActorHost({system.agent(), name}, std::move(factory), seed),
      system_(system),
      own_pool_(options.placement == Placement::kOwnThread ? std::make_unique<WorkerPool>(name, 1) : nullptr),
      pool_(own_pool_ ? *own_pool_ : pool),
      supervisor_({.restarts_max = system.options_.restarts_max, .restart_period = system.options_.restart_period}),
      mailbox_(options) {}

SendResult ActorSystem::Impl::Cell::Push(MessagePtr message) {
  const std::size_t bytes = message->ByteSizeLong();
  const std::lock_guard lock(mutex_);
  if (state_ == State::kBeyondHelp || state_ == State::kEnded) return SendResult::kUnreachable;
  if (!mailbox_.Push(std::move(message), bytes)) return SendResult::kFull;
  SubmitIfDue();
  return SendResult::kAccepted;
}

void ActorSystem::Impl::Cell::PushSystem(MessagePtr message, std::uint64_t incarnation) {
  const std::lock_guard lock(mutex_);
  if (state_ == State::kBeyondHelp || state_ == State::kEnded) return;
  mailbox_.PushSystem(std::move(message), incarnation);
  SubmitIfDue();
}

void ActorSystem::Impl::Cell::Wake() {
  const std::lock_guard lock(mutex_);
  SubmitIfDue();
}

void ActorSystem::Impl::Cell::BeginStart() {
  const std::lock_guard lock(mutex_);
  is_start_due_ = true;
  SubmitIfDue();
}

void ActorSystem::Impl::Cell::WaitUntilStarted() {
  std::unique_lock lock(mutex_);
  state_changed_.wait(lock, [this] { return state_ != State::kAway; });
}

void ActorSystem::Impl::Cell::EndAndWait() {
  std::unique_lock lock(mutex_);
  is_end_due_ = true;
  SubmitIfDue();
  state_changed_.wait(lock, [this] { return state_ == State::kEnded; });
}

void ActorSystem::Impl::Cell::Join() {
  if (own_pool_) own_pool_->Join();
}

proto::ActorStatus ActorSystem::Impl::Cell::Status() const {
  proto::ActorStatus status;
  status.set_name(self().actor);
  status.set_handled(static_cast<double>(handled()));
  const std::lock_guard lock(mutex_);
  status.set_queued(static_cast<double>(mailbox_.size()));
  status.set_queued_max(static_cast<double>(mailbox_.size_max()));
  status.set_dropped(static_cast<double>(mailbox_.dropped()));
  status.set_restarts(static_cast<double>(restarts_));
  return status;
}

std::int64_t ActorSystem::Impl::Cell::utc_now_ns() const {
  return std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()).count();
}

TimerId ActorSystem::Impl::Cell::After(Duration delay, proto::Message message) {
  WriteEnvelope(self(), self(), message);
  auto shared = std::make_shared<const proto::Message>(std::move(message));
  return system_.timers().Add(now() + delay, [this, shared = std::move(shared), incarnation = incarnation()] {
    PushSystem(shared, incarnation);
  });
}

bool ActorSystem::Impl::Cell::HasMessageDue() const {
  return state_ == State::kReady && system_.is_flowing() && !system_.is_stopping() && !mailbox_.empty();
}

void ActorSystem::Impl::Cell::SubmitIfDue() {
  if (is_submitted_ || !HasWork()) return;
  is_submitted_ = true;
  pool_.Submit([this] { RunTurn(); });
}

void ActorSystem::Impl::Cell::RunTurn() {
  for (int i = 0; i < kTurnMessages; ++i) {
    if (!RunStep()) return;
  }
  const std::lock_guard lock(mutex_);
  is_submitted_ = false;
  SubmitIfDue();
}

bool ActorSystem::Impl::Cell::RunStep() {
  std::unique_lock lock(mutex_);
  if (!HasWork()) {
    is_submitted_ = false;
    return false;
  }
  if (is_end_due_) {
    lock.unlock();
    End();
    EnterState(State::kEnded);
    return true;
  }
  if (std::exchange(is_start_due_, false)) {
    lock.unlock();
    const std::optional<Error> failure = ActorHost::Start();
    if (!failure) EnterState(State::kReady);
    SettleHandler(failure);
    return true;
  }
  const std::optional<Mailbox::Item> item = mailbox_.Pop();
  lock.unlock();
  // Else the timer of an incarnation that died.
  if (item->incarnation == 0 || item->incarnation == incarnation()) SettleHandler(Handle(*item->message));
  return true;
}

void ActorSystem::Impl::Cell::SettleHandler(const std::optional<Error>& failure) {
  if (failure) Recover(*failure);
  if (TakeStopRequest()) system_.OnStopRequested();
}

void ActorSystem::Impl::Cell::Recover(const Error& failure) {
  const std::optional<Duration> delay = supervisor_.OnFailure(now());
  if (!delay) {
    EnterState(State::kBeyondHelp);
    system_.OnBeyondHelp(self(), failure);
    return;
  }
  EnterState(State::kAway);
  {
    const std::lock_guard lock(mutex_);
    ++restarts_;
    is_start_due_ = *delay == Duration::zero();
  }
  if (*delay > Duration::zero()) system_.timers().Add(now() + *delay, [this] { BeginStart(); });
}

void ActorSystem::Impl::Cell::EnterState(State state) {
  {
    const std::lock_guard lock(mutex_);
    if (state_ == state) return;
    state_ = state;
    if (state == State::kBeyondHelp || state == State::kEnded) mailbox_.Clear();
  }
  state_changed_.notify_all();
}

// --- System ---

ActorSystem::Impl::Impl(Options options)
    : options_(std::move(options)),
      seed_(SeedOf(options_.seed)),
      roles_(options_.base_station),
      pool_("workers", options_.worker_count) {
  Check(options_.self >= 1 && options_.self <= kAgentIdMax, "an agent's id is from 1 to 65535");
}

void ActorSystem::Impl::Spawn(std::string name, SpawnOptions options, ActorFactory factory) {
  Check(!is_started_, "actors are spawned before Start");
  Check(!cell_of_.contains(name), "names of actors are unique");
  cells_.push_back(std::make_unique<Cell>(*this, name, options, std::move(factory), pool_, seed_));
  cell_of_.emplace(std::move(name), cells_.back().get());
}

void ActorSystem::Impl::Start(Transport* transport) {
  Check(!std::exchange(is_started_, true), "a system is started once");
  started_ = std::chrono::steady_clock::now();
  transport_ = transport;
  for (const auto& cell : cells_) {
    if (is_stopping_) return;
    cell->BeginStart();
    cell->WaitUntilStarted();
  }
  is_flowing_ = true;
  for (const auto& cell : cells_) cell->Wake();
  if (transport == nullptr) return;
  // A peer that was reached before this is not told of again by the transport.
  for (const proto::PeerStatus& peer : transport->Peers()) {
    if (peer.is_connected()) OnPeerChanged(peer.agent_id(), true);
  }
}

ActorSystem::Impl::Cell* ActorSystem::Impl::Find(const std::string& actor) {
  const auto found = cell_of_.find(actor);
  return found == cell_of_.end() ? nullptr : found->second;
}

SendResult ActorSystem::Impl::Send(const Address& from, const Address& to, proto::Message message) {
  const Address resolved{roles_.Resolve(to.agent), to.actor};
  if (resolved.agent == 0) return SendResult::kNoPeer;
  WriteEnvelope(from, resolved, message);
  auto shared = std::make_shared<const proto::Message>(std::move(message));
  if (resolved.agent == options_.self) return Deliver(std::move(shared));
  Transport* transport = transport_;
  if (transport == nullptr) return resolved.agent == kClients ? SendResult::kUnreachable : SendResult::kNoPeer;
  return transport->Send(resolved, std::move(shared));
}

SendResult ActorSystem::Impl::Deliver(MessagePtr message) {
  Cell* cell = Find(message->destination_actor());
  return cell == nullptr ? SendResult::kNoActor : cell->Push(std::move(message));
}

void ActorSystem::Impl::OnPeerChanged(AgentId peer, bool is_connected) {
  for (const char* name : kToldOfPeers) {
    Cell* cell = Find(name);
    if (cell == nullptr) continue;
    proto::Message message;
    message.mutable_peer_event()->set_peer(peer);
    message.mutable_peer_event()->set_is_connected(is_connected);
    WriteEnvelope({options_.self, "transport"}, cell->self(), message);
    cell->PushSystem(std::make_shared<const proto::Message>(std::move(message)), /*incarnation=*/0);
  }
}

void ActorSystem::Impl::OnBeyondHelp(const Address& actor, const Error& error) {
  if (is_fatal_.exchange(true)) return;
  const Error fatal{error.code, "actor " + ToString(actor) + " is beyond help: " + ToString(error), {}};
  spdlog::critical("{}", ToString(fatal));
  if (!options_.on_fatal) std::abort();
  options_.on_fatal(fatal);
}

void ActorSystem::Impl::Stop() {
  is_stopping_ = true;
  const std::lock_guard lock(stop_mutex_);
  timers_.Join();
  for (auto cell = cells_.rbegin(); cell != cells_.rend(); ++cell) (*cell)->EndAndWait();
  for (const auto& cell : cells_) cell->Join();
  pool_.Join();
}

SystemStatus ActorSystem::Impl::Status() const {
  SystemStatus status;
  status.uptime = std::chrono::steady_clock::now() - started_;
  for (const auto& cell : cells_) status.actors.push_back(cell->Status());
  if (const Transport* transport = transport_) status.peers = transport->Peers();
  return status;
}

// --- ActorSystem ---

ActorSystem::ActorSystem(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
ActorSystem::~ActorSystem() = default;

void ActorSystem::Spawn(std::string name, SpawnOptions options, ActorFactory factory) {
  impl_->Spawn(std::move(name), options, std::move(factory));
}
void ActorSystem::Start(Transport* transport) { impl_->Start(transport); }
SendResult ActorSystem::Deliver(MessagePtr message) { return impl_->Deliver(std::move(message)); }
void ActorSystem::OnPeerChanged(AgentId peer, bool is_connected) { impl_->OnPeerChanged(peer, is_connected); }
SendResult ActorSystem::Post(const std::string& actor, proto::Message message) {
  return impl_->Send({impl_->agent(), "outside"}, {impl_->agent(), actor}, std::move(message));
}
void ActorSystem::Stop() { impl_->Stop(); }

}  // namespace moondb
