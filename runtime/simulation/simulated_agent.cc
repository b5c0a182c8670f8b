#include "runtime/simulation/simulated_agent.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "model/check.h"
#include "runtime/actor_host.h"
#include "runtime/envelope.h"
#include "runtime/supervisor.h"

namespace moondb::simulation {

class SimulatedAgent::Host final : public ActorHost {
 public:
  Host(SimulatedAgent& owner, const SpawnedActor& spawned, std::uint64_t seed)
      : ActorHost({owner.id_, spawned.name}, spawned.factory, seed),
        mailbox(spawned.options),
        supervisor(Supervision(owner, spawned.name)),
        boot(owner.boot_),
        trace_name(spawned.trace_name),
        agent_(owner) {}

  bool is_alive() const { return agent_.boot_ == boot; }

  MonotonicTime now() const override { return agent_.team_.now(); }
  std::int64_t utc_now_ns() const override { return agent_.team_.utc_now_ns() + agent_.utc_offset_.count(); }
  SendResult Send(const Address& to, OwnedMessage message) override {
    CrashAt(Fault::kAtFirstSend);
    const SendResult result =
        is_alive() ? agent_.team_.Send(self(), to, std::move(*message)) : SendResult::kUnreachable;
    CrashAt(Fault::kAfterFirstSend);
    return result;
  }
  TimerId After(Duration delay, proto::Message message) override {
    return agent_.StartTimer(*this, delay, std::move(message));
  }
  void Cancel(TimerId timer) override { agent_.team_.events().Cancel(timer); }
  void WatchPeers() override {
    if (is_alive()) agent_.Notify(agent_.monitors_.WatchPeers(self().actor));
  }
  void Watch(Topic topic) override {
    if (is_alive()) agent_.Watch(self().actor, topic);
  }
  void Publish(OwnedMessage message) override {
    CrashAt(Fault::kAtFirstSend);
    if (is_alive()) agent_.Notify(agent_.monitors_.Publish(self().actor, *message));
    CrashAt(Fault::kAfterFirstSend);
  }
  void Monitor(const Address& target) override {
    if (!is_alive()) return;
    const bool is_lost = agent_.FindHost(target.actor) == nullptr;
    agent_.Notify(agent_.monitors_.Monitor(self().actor, Resolved(target), is_lost));
  }
  void Demonitor(const Address& target) override {
    if (is_alive()) agent_.monitors_.Demonitor(self().actor, Resolved(target));
  }
  bool stop_requested() const override { return !is_alive(); }
  void SetRoles(const proto::RoleAssignment& roles) override {
    if (is_alive()) agent_.roles_.SetRoles(roles);
  }
  SystemStatus GetSystemStatus() const override { return agent_.Status(); }
  proto::TraceReply GetTrace(const proto::TraceRequest& request) const override { return agent_.Trace(request); }

  Mailbox mailbox;
  Supervisor supervisor;
  std::uint64_t restarts = 0;
  Fault injected = Fault::kNone;  // Fault injected into the running handler.
  const std::uint64_t boot;
  const std::uint16_t trace_name;

 private:
  static Supervisor::Options Supervision(const SimulatedAgent& owner, const std::string& name) {
    Supervisor::Options options;
    for (const SpawnedActor& other : owner.spawned_) options.can_step_down |= other.name == actor_name::kRole;
    options.can_step_down &= name != actor_name::kRole;
    return options;
  }

  void CrashAt(Fault fault) const {
    if (injected != fault) return;
    throw std::runtime_error(fault == Fault::kAtFirstSend ? "crashed by the test at its first send"
                                                          : "crashed by the test after its first send");
  }

  Address Resolved(const Address& target) const { return {agent_.Resolve(target.agent), target.actor}; }

  SimulatedAgent& agent_;
};

SimulatedAgent::SimulatedAgent(AgentSurroundings& team, AgentId id, std::uint64_t seed)
    : team_(team), id_(id), seed_(seed), started_(team.now()), monitors_(id), trace_(id, /*ns_per_tick=*/1) {}

SimulatedAgent::~SimulatedAgent() = default;

// --- Crash and restart of the process ---

void SimulatedAgent::SetRoles(const proto::RoleAssignment& roles) {
  given_roles_ = roles;
  roles_.SetRoles(roles);
}

void SimulatedAgent::Crash() {
  if (!is_running_) return;
  is_running_ = false;
  ++boot_;
  crashed_ = team_.now();
  team_.OnCrashed(id_);
  for (auto host = hosts_.rbegin(); host != hosts_.rend(); ++host) {
    (*host)->mailbox.Close();
    if (!(*host)->is_in_handler()) (*host)->End();  // An actor in a handler is destroyed later, by SettleHandler.
  }
}

void SimulatedAgent::Restart(const std::vector<AgentId>& connected) {
  Check(!is_running_, "only a crashed agent is restarted");
  for (const auto& host : hosts_) Check(!host->is_in_handler(), "no handler restarts its own agent");
  hosts_.clear();
  is_running_ = true;
  started_ = team_.now();
  roles_.SetRoles(given_roles_);
  peers_.clear();
  monitors_ = Monitors(id_);
  for (const AgentId peer : connected) OnPeerAtStart(peer);
  // Create all mailboxes before the first OnStart sends a message.
  for (const SpawnedActor& spawned : spawned_) MakeHost(spawned);
  for (const auto& host : hosts_) {
    if (host->is_alive()) StartHost(*host);
  }
}

void SimulatedAgent::OnPeerChanged(AgentId peer, bool is_connected) {
  if (is_running_) Notify(monitors_.OnPeerChanged(peer, is_connected));
}

void SimulatedAgent::Notify(Monitors::Notices notices) {
  for (Monitors::Notice& notice : notices) {
    (void)team_.HandOver({id_, notice.watcher}, std::move(notice.message), /*sender=*/nullptr);
  }
}

// --- Actors ---

void SimulatedAgent::Spawn(SpawnedActor spawned) {
  Check(is_running_, "an actor is spawned on a running agent");
  for (const SpawnedActor& other : spawned_) Check(other.name != spawned.name, "names of actors are unique");
  spawned.trace_name = trace_.AddName(spawned.name);
  spawned_.push_back(std::move(spawned));
  MakeHost(spawned_.back());
  StartHost(*hosts_.back());
}

void SimulatedAgent::MakeHost(const SpawnedActor& spawned) {
  // A restarted agent draws other random numbers, as a new process would.
  hosts_.push_back(std::make_unique<Host>(*this, spawned, seed_ + boot_ - 1));
}

void SimulatedAgent::StartHost(Host& host) {
  while (SettleHandler(host, nullptr, host.Start())) {
  }
  // Schedule the messages that arrived while the actor was down.
  const std::size_t waiting = host.mailbox.counts().waiting;
  for (std::size_t i = 0; host.has_actor() && i < waiting; ++i) ScheduleStep(host);
}

SimulatedAgent::Host* SimulatedAgent::FindHost(const std::string& actor) const {
  for (const auto& host : hosts_) {
    if (host->self().actor == actor) return host.get();
  }
  return nullptr;
}

std::optional<SendResult> SimulatedAgent::Push(const std::string& actor, OwnedMessage& message, const Address* sender) {
  Host* host = FindHost(actor);
  if (host == nullptr) return std::nullopt;
  Mailbox::Item item;
  item.bytes = message->ByteSizeLong();
  item.message = std::move(message);
  item.sender = sender;
  const SendResult result = host->mailbox.Push(std::move(item)).result;
  if (result == SendResult::kAccepted) ScheduleStep(*host);
  return result;
}

TimerId SimulatedAgent::StartTimer(Host& host, Duration delay, proto::Message message) {
  WriteLocalEnvelope(id_, id_, message);
  const Address* sender = team_.Remember(host.self());
  return team_.events().Add(
      team_.now() + std::max(delay, Duration::zero()),
      [this, boot = host.boot, &host, incarnation = host.incarnation(), sender, message = std::move(message)] {
        if (boot_ != boot) return;
        Mailbox::Item item;
        item.message = proto::Message(message);
        item.sender = sender;
        item.is_timer = true;
        item.incarnation = incarnation;
        (void)host.mailbox.Push(std::move(item));
        ScheduleStep(host);
      });
}

void SimulatedAgent::ScheduleStep(Host& host) {
  team_.events().Add(team_.now(), [this, boot = host.boot, &host] {
    if (boot_ == boot) Step(host);
  });
}

void SimulatedAgent::Step(Host& host) {
  // If the actor is down, messages stay in the mailbox. At the restart, StartHost schedules a step for each of them.
  if (!host.has_actor()) return;
  Mailbox::Item* taken = host.mailbox.Take();
  if (taken == nullptr) return;
  Mailbox::Item item = std::move(*taken);
  if (item.is_timer && item.incarnation != host.incarnation()) return;  // Skip a timer of an earlier incarnation.
  team_.Trace(host.self(), item.sender != nullptr ? *item.sender : SenderOf(*item.message), *item.message);
  if (SettleHandler(host, &item, Handle(host, item))) StartHost(host);
}

std::optional<Error> SimulatedAgent::Handle(Host& host, const Mailbox::Item& item) {
  const Fault injected = team_.FaultFor(host.self(), *item.message);
  const Error crashed{ErrorCode::kInternal, "crashed by the test", {}};
  if (injected == Fault::kBeforeHandler) {
    host.End();
    return crashed;
  }
  host.injected = injected;
  std::optional<Error> failure = host.Handle(*item.message, item.sender);
  host.injected = Fault::kNone;
  TraceRecord record;
  record.time = team_.now().time_since_epoch().count();
  record.kind = failure ? proto::TRACE_FAILED : proto::TRACE_HANDLED;
  record.actor = host.trace_name;
  record.body = static_cast<std::uint16_t>(item.message->body_case());
  record.other_agent = item.message->hop_sender();
  record.bytes = static_cast<std::uint32_t>(item.bytes);
  record.request_id = item.message->request_id();
  trace_.Add(record);
  if (failure || injected == Fault::kNone) return failure;
  host.End();
  return crashed;
}

// --- Supervision ---

bool SimulatedAgent::SettleHandler(Host& host, Mailbox::Item* item, const std::optional<Error>& failure) {
  if (!host.is_alive()) {  // The agent crashed during the handler.
    host.End();
    return false;
  }
  if (host.TakeStopRequest()) {
    Crash();
    return false;
  }
  return failure && Recover(host, item, *failure);
}

bool SimulatedAgent::Recover(Host& host, Mailbox::Item* item, const Error& failure) {
  const MonotonicTime now = team_.now();
  dead_letters_.Add(now, host.self().actor, item, failure);
  const double jitter = static_cast<double>(host.rng()() >> 11) * 0x1.0p-53;
  const Supervisor::Verdict verdict = host.supervisor.OnFailure(failure, now, jitter);
  const bool is_final = verdict.action == Supervisor::Action::kBeyondHelp;
  Notify(monitors_.OnActorDown(host.self().actor, ToString(failure), is_final));
  if (is_final) {
    spdlog::warn("actor {} has failed permanently, agent {} crashes", ToString(host.self()), id_);
    Crash();
    return false;
  }
  if (verdict.action == Supervisor::Action::kStepDown) StepDown(host, failure);
  ++host.restarts;
  ++restarts_;
  if (verdict.delay == Duration::zero()) return true;
  team_.events().Add(now + verdict.delay, [this, boot = host.boot, &host] {
    if (boot_ == boot) StartHost(host);
  });
  return false;
}

void SimulatedAgent::StepDown(const Host& failed, const Error& failure) {
  OwnedMessage message;
  message->mutable_step_down()->set_actor(failed.self().actor);
  message->mutable_step_down()->set_reason(ToString(failure));
  WriteLocalEnvelope(id_, id_, *message);
  (void)team_.HandOver({id_, actor_name::kRole}, std::move(message), team_.Remember({id_, "outside"}));
}

void SimulatedAgent::CrashActor(const std::string& actor) {
  Host* host = FindHost(actor);
  Check(host != nullptr && host->has_actor() && !host->is_in_handler(), "an actor that exists and is idle");
  host->End();
  if (SettleHandler(*host, nullptr, Error{ErrorCode::kInternal, "crashed by the test", {}})) StartHost(*host);
}

// --- Status ---

SystemStatus SimulatedAgent::Status() const {
  SystemStatus status;
  status.uptime = team_.now() - started_;
  for (const auto& host : hosts_) {
    proto::ActorStatus& actor = status.actors.emplace_back();
    actor.set_name(host->self().actor);
    actor.set_handled(static_cast<double>(host->handled()));
    const Mailbox::Counts counts = host->mailbox.counts();
    actor.set_queued(static_cast<double>(counts.waiting));
    actor.set_queued_max(static_cast<double>(counts.waiting_max));
    actor.set_dropped(static_cast<double>(counts.dropped));
    actor.set_restarts(static_cast<double>(host->restarts));
  }
  status.peers = team_.PeersOf(*this);
  return status;
}

proto::TraceReply SimulatedAgent::Trace(const proto::TraceRequest& request) const {
  proto::TraceReply reply;
  trace_.Report(request, team_.now().time_since_epoch().count(), &reply);
  dead_letters_.Report(request, team_.now(), &reply);
  return reply;
}

}  // namespace moondb::simulation
