#include "runtime/simulation/simulated_team.h"

#include <spdlog/spdlog.h>
#include <xxhash.h>

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "model/check.h"
#include "runtime/actor_host.h"
#include "runtime/dead_letters.h"
#include "runtime/envelope.h"
#include "runtime/mailbox.h"
#include "runtime/monitors.h"
#include "runtime/role_table.h"
#include "runtime/supervisor.h"
#include "runtime/system_status.h"
#include "runtime/timer_queue.h"
#include "runtime/trace_book.h"

namespace moondb::simulation {
namespace {

constexpr std::int64_t kUtcStart_ns = 1'767'225'600'000'000'000;  // 2026-01-01.
// Not zero, so that a "last time" that was never set does not look like the start.
constexpr MonotonicTime kStart(std::chrono::seconds(1000));
constexpr std::size_t kKeptMax = 100'000;
constexpr std::uint64_t kEventsAtOnceMax = 1'000'000;

}  // namespace

// Everything is an event of one queue. An event that belongs to an agent's process checks, when it is due, that it is
// still the same life of that process; one that belongs to an actor, that it is still the same incarnation.
class SimulatedTeam::Impl {
 public:
  explicit Impl(std::uint64_t seed) : seed_(seed), radio_(seed) {}
  ~Impl();

  class Host;

  struct SpawnedActor {
    std::string name;
    ActorFactory factory;
    SpawnOptions options;
    std::uint16_t trace_name = 0;
  };

  struct PeerCounters {
    std::uint64_t sent_messages = 0;
    std::uint64_t sent_bytes = 0;
    std::uint64_t received_messages = 0;
    std::uint64_t received_bytes = 0;
    std::optional<MonotonicTime> heard;
  };

  struct Agent {
    explicit Agent(AgentId agent) : id(agent), monitors(agent), trace(agent, /*ns_per_tick=*/1) {}

    const AgentId id;
    bool is_running = true;
    std::uint64_t life = 1;  // Ends with each crash.
    MonotonicTime started;
    MonotonicTime crashed;
    Duration utc_offset{};
    RoleTable roles;
    proto::RoleAssignment given_roles;  // By SetRoles; what the agent's process knows when it starts.
    std::vector<SpawnedActor> spawned;
    std::vector<std::unique_ptr<Host>> hosts;  // One for each of spawned.
    std::uint64_t restarts = 0;
    std::map<AgentId, PeerCounters> peers;
    Monitors monitors;
    TraceBook trace;  // Of all lives, as are the dead letters.
    DeadLetters dead_letters;
  };

  void AddAgent(AgentId id);
  void SetBaseStation(AgentId base_station);
  void SetRoles(AgentId id, const proto::RoleAssignment& roles);
  void Spawn(AgentId id, SpawnedActor spawned);
  SendResult Post(const Address& from, const Address& to, proto::Message message);
  std::vector<proto::Message> Take(const Address& address);
  void Watch(const Address& actor, Topic topic);
  void RunUntilIdle();
  void AdvanceTime(Duration duration);
  bool RunUntil(const std::function<bool()>& condition, Duration limit);
  void Crash(Agent& agent);
  void Restart(Agent& agent);
  void SetLink(AgentId a, AgentId b, bool is_up, bool tell);
  void Partition(const std::vector<std::vector<AgentId>>& groups);
  void CrashActor(const Address& actor);
  std::optional<proto::Message> Expect(const Address& probe, proto::Message::BodyCase body, Duration limit);
  void RecordSent(const Address& actor) { sent_[actor]; }
  std::vector<proto::Message> TakeSent(const Address& actor);

  Agent& Find(AgentId id);

  // For hosts.
  SendResult Send(const Address& from, const Address& to, proto::Message message);
  TimerId StartTimer(Host& host, Duration delay, proto::Message message);
  void CancelTimer(TimerId timer) { events_.Cancel(timer); }
  SystemStatus StatusOf(const Agent& agent) const;
  proto::TraceReply TraceOf(const Agent& agent, const proto::TraceRequest& request) const;
  void Notify(Agent& agent, Monitors::Notices notices);

  MonotonicTime now() const { return now_; }
  std::int64_t utc_now_ns() const { return kUtcStart_ns + Duration(now_ - kStart).count(); }

  SimulatedRadio& radio() { return radio_; }
  std::uint64_t trace_hash() const { return trace_hash_; }

  std::function<bool(AgentId, AgentId, const proto::Message&)> filter;
  std::function<Fault(const Address&, const proto::Message&)> fault;

 private:
  using Event = std::function<void()>;

  void MakeHost(Agent& agent, const SpawnedActor& spawned);
  void StartHost(Host& host);
  // What a handler left behind; true if the actor is to be started again at once. `item` is what it handled; null in
  // OnStart and between messages.
  bool SettleHandler(Host& host, Mailbox::Item* item, const std::optional<Error>& failure);
  bool Recover(Host& host, Mailbox::Item* item, const Error& failure);
  void StepDown(Agent& agent, const Host& failed, const Error& failure);
  std::optional<Error> Handle(Host& host, const Mailbox::Item& item);
  void Connect(Agent& agent);  // What its Monitors know at the start.
  void ScheduleStep(Host& host);
  void Step(Host& host);
  void Tell(Agent& agent, AgentId peer, bool is_connected);
  Host* FindHost(Agent& agent, const std::string& actor);

  // `sender` as in Mailbox::Item.
  SendResult HandOver(const Address& to, OwnedMessage message, const Address* sender);
  SendResult Route(const Address& from, const Address& resolved, proto::Message&& message);
  SendResult Transmit(const Address& from, const Address& to, const proto::Message& message);
  void Arrive(AgentId from, AgentId to, const std::string& bytes);
  void Keep(const Address& address, const proto::Message& message);
  void Trace(const Address& to, const Address& sender, const proto::Message& message);

  bool RunNextEvent(MonotonicTime end);
  void RunEventsUntil(MonotonicTime end);

  const std::uint64_t seed_;
  MonotonicTime now_ = kStart;
  TimerQueue<Event> events_;
  std::uint64_t events_at_now_ = 0;
  SimulatedRadio radio_;
  AgentId base_station_ = 0;
  std::map<AgentId, std::unique_ptr<Agent>> agents_;
  std::map<Address, std::vector<proto::Message>> kept_;
  std::size_t kept_count_ = 0;
  std::set<Address> senders_;                            // Of messages within an agent, for as long as any may wait.
  std::map<Address, std::vector<proto::Message>> sent_;  // Of those that are recorded.
  std::size_t sent_count_ = 0;
  std::uint64_t trace_hash_ = 0;
};

class SimulatedTeam::Impl::Host final : public ActorHost {
 public:
  Host(Impl& team, Agent& owner, const SpawnedActor& spawned, std::uint64_t seed)
      : ActorHost({owner.id, spawned.name}, spawned.factory, seed),
        mailbox(spawned.options),
        supervisor(Supervision(owner, spawned.name)),
        agent(owner),
        life(owner.life),
        trace_name(spawned.trace_name),
        team_(team) {}

  bool is_alive() const { return agent.life == life; }

  MonotonicTime now() const override { return team_.now(); }
  std::int64_t utc_now_ns() const override { return team_.utc_now_ns() + agent.utc_offset.count(); }
  SendResult Send(const Address& to, OwnedMessage message) override {
    if (injected == Fault::kAtFirstSend) throw std::runtime_error("crashed by the test at its first send");
    const SendResult result = is_alive() ? team_.Send(self(), to, std::move(*message)) : SendResult::kUnreachable;
    if (injected == Fault::kAfterFirstSend) throw std::runtime_error("crashed by the test after its first send");
    return result;
  }
  TimerId After(Duration delay, proto::Message message) override {
    return team_.StartTimer(*this, delay, std::move(message));
  }
  void Cancel(TimerId timer) override { team_.CancelTimer(timer); }
  void WatchPeers() override {
    if (is_alive()) team_.Notify(agent, agent.monitors.WatchPeers(self().actor));
  }
  void Watch(Topic topic) override {
    if (is_alive()) team_.Notify(agent, agent.monitors.Watch(self().actor, topic));
  }
  void Publish(OwnedMessage message) override {
    if (is_alive()) team_.Notify(agent, agent.monitors.Publish(self().actor, *message));
  }
  void Monitor(const Address& target) override;
  void Demonitor(const Address& target) override {
    if (is_alive()) agent.monitors.Demonitor(self().actor, {agent.roles.Resolve(target.agent), target.actor});
  }
  bool stop_requested() const override { return !is_alive(); }
  void SetRoles(const proto::RoleAssignment& roles) override {
    if (is_alive()) agent.roles.SetRoles(roles);
  }
  SystemStatus GetSystemStatus() const override { return team_.StatusOf(agent); }
  proto::TraceReply GetTrace(const proto::TraceRequest& request) const override {
    return team_.TraceOf(agent, request);
  }

  Mailbox mailbox;
  Supervisor supervisor;
  std::uint64_t restarts = 0;
  Fault injected = Fault::kNone;  // Into the handler that runs.
  Agent& agent;
  const std::uint64_t life;
  const std::uint16_t trace_name;

 private:
  static Supervisor::Options Supervision(const Agent& owner, const std::string& name) {
    Supervisor::Options options;
    for (const SpawnedActor& other : owner.spawned) options.can_step_down |= other.name == actor_name::kRole;
    options.can_step_down &= name != actor_name::kRole;
    return options;
  }

  Impl& team_;
};

void SimulatedTeam::Impl::Host::Monitor(const Address& target) {
  if (!is_alive()) return;
  const Address resolved{agent.roles.Resolve(target.agent), target.actor};
  const bool is_lost = team_.FindHost(agent, target.actor) == nullptr;
  team_.Notify(agent, agent.monitors.Monitor(self().actor, resolved, is_lost));
}

SimulatedTeam::Impl::~Impl() {
  for (const auto& [id, agent] : agents_) Crash(*agent);
}

// --- The team ---

SimulatedTeam::Impl::Agent& SimulatedTeam::Impl::Find(AgentId id) {
  const auto found = agents_.find(id);
  Check(found != agents_.end(), "the agent was added");
  return *found->second;
}

void SimulatedTeam::Impl::AddAgent(AgentId id) {
  Check(id >= 1 && id <= kAgentIdMax, "an agent's id is from 1 to 65535");
  auto agent = std::make_unique<Agent>(id);
  agent->started = now_;
  agent->roles.SetBaseStation(base_station_);
  const auto [added, is_new] = agents_.emplace(id, std::move(agent));
  Check(is_new, "an agent is added once");
  Connect(*added->second);
  for (const auto& [other_id, other] : agents_) {
    if (other_id != id && radio_.is_up(id, other_id)) Tell(*other, id, true);
  }
}

void SimulatedTeam::Impl::Connect(Agent& agent) {
  for (const auto& [id, other] : agents_) {
    if (id != agent.id && radio_.is_up(agent.id, id)) (void)agent.monitors.OnPeerChanged(id, true);
  }
}

void SimulatedTeam::Impl::SetBaseStation(AgentId base_station) {
  base_station_ = base_station;
  for (const auto& [id, agent] : agents_) agent->roles.SetBaseStation(base_station);
}

void SimulatedTeam::Impl::SetRoles(AgentId id, const proto::RoleAssignment& roles) {
  Agent& agent = Find(id);
  agent.given_roles = roles;
  agent.roles.SetRoles(roles);
}

void SimulatedTeam::Impl::SetLink(AgentId a, AgentId b, bool is_up, bool tell) {
  radio_.SetLink(a, b, is_up, tell);
  if (!tell) return;
  for (const auto& [end, peer] : {std::pair(a, b), std::pair(b, a)}) {
    if (agents_.contains(end)) Tell(Find(end), peer, is_up);
  }
}

void SimulatedTeam::Impl::Partition(const std::vector<std::vector<AgentId>>& groups) {
  const auto group_of = [&](AgentId agent) {
    std::size_t group = 0;
    while (group < groups.size() &&
           std::find(groups[group].begin(), groups[group].end(), agent) == groups[group].end()) {
      ++group;
    }
    return group;
  };
  for (auto a = agents_.begin(); a != agents_.end(); ++a) {
    for (auto b = std::next(a); b != agents_.end(); ++b) {
      SetLink(a->first, b->first, group_of(a->first) == group_of(b->first), /*tell=*/true);
    }
  }
}

// --- Actors ---

void SimulatedTeam::Impl::Spawn(AgentId id, SpawnedActor spawned) {
  Agent& agent = Find(id);
  Check(agent.is_running, "an actor is spawned on a running agent");
  for (const SpawnedActor& other : agent.spawned) Check(other.name != spawned.name, "names of actors are unique");
  spawned.trace_name = agent.trace.AddName(spawned.name);
  agent.spawned.push_back(std::move(spawned));
  MakeHost(agent, agent.spawned.back());
  StartHost(*agent.hosts.back());
}

void SimulatedTeam::Impl::MakeHost(Agent& agent, const SpawnedActor& spawned) {
  // Another life draws other numbers, as another process would.
  agent.hosts.push_back(std::make_unique<Host>(*this, agent, spawned, seed_ + agent.life - 1));
}

void SimulatedTeam::Impl::StartHost(Host& host) {
  while (SettleHandler(host, nullptr, host.Start())) {
  }
  // What came while the actor was away.
  const std::size_t waiting = host.mailbox.counts().waiting;
  for (std::size_t i = 0; host.has_actor() && i < waiting; ++i) ScheduleStep(host);
}

bool SimulatedTeam::Impl::SettleHandler(Host& host, Mailbox::Item* item, const std::optional<Error>& failure) {
  if (!host.is_alive()) {  // Crashed while it ran.
    host.End();
    return false;
  }
  if (host.TakeStopRequest()) {
    Crash(host.agent);
    return false;
  }
  return failure && Recover(host, item, *failure);
}

bool SimulatedTeam::Impl::Recover(Host& host, Mailbox::Item* item, const Error& failure) {
  Agent& agent = host.agent;
  agent.dead_letters.Add(now_, host.self().actor, item, failure);
  const double jitter = static_cast<double>(host.rng()() >> 11) * 0x1.0p-53;
  const Supervisor::Verdict verdict = host.supervisor.OnFailure(failure, now_, jitter);
  const bool is_final = verdict.action == Supervisor::Action::kBeyondHelp;
  Notify(agent, agent.monitors.OnActorDown(host.self().actor, ToString(failure), is_final));
  if (is_final) {
    spdlog::warn("actor {} is beyond help, agent {} crashes", ToString(host.self()), agent.id);
    Crash(agent);
    return false;
  }
  if (verdict.action == Supervisor::Action::kStepDown) StepDown(agent, host, failure);
  ++host.restarts;
  ++agent.restarts;
  if (verdict.delay == Duration::zero()) return true;
  events_.Add(now_ + verdict.delay, [this, &agent, life = host.life, &host] {
    if (agent.life == life) StartHost(host);
  });
  return false;
}

void SimulatedTeam::Impl::StepDown(Agent& agent, const Host& failed, const Error& failure) {
  proto::Message message;
  message.mutable_step_down()->set_actor(failed.self().actor);
  message.mutable_step_down()->set_reason(ToString(failure));
  (void)Route({agent.id, "outside"}, {agent.id, actor_name::kRole}, std::move(message));
}

void SimulatedTeam::Impl::CrashActor(const Address& actor) {
  Host* host = FindHost(Find(actor.agent), actor.actor);
  Check(host != nullptr && host->has_actor() && !host->is_in_handler(), "an actor that is there and at rest");
  host->End();
  if (SettleHandler(*host, nullptr, Error{ErrorCode::kInternal, "crashed by the test", {}})) StartHost(*host);
}

void SimulatedTeam::Impl::ScheduleStep(Host& host) {
  events_.Add(now_, [this, &agent = host.agent, life = host.life, &host] {
    if (agent.life == life) Step(host);
  });
}

void SimulatedTeam::Impl::Step(Host& host) {
  if (!host.has_actor()) return;  // Waits to be made anew; the mailbox is kept, StartHost schedules again.
  Mailbox::Item* taken = host.mailbox.Take();
  if (taken == nullptr) return;
  Mailbox::Item item = std::move(*taken);
  if (item.is_timer && item.incarnation != host.incarnation()) return;  // Of one that died.
  Trace(host.self(), item.sender != nullptr ? *item.sender : SenderOf(*item.message), *item.message);
  if (SettleHandler(host, &item, Handle(host, item))) StartHost(host);
}

std::optional<Error> SimulatedTeam::Impl::Handle(Host& host, const Mailbox::Item& item) {
  const Fault injected = fault ? fault(host.self(), *item.message) : Fault::kNone;
  const Error crashed{ErrorCode::kInternal, "crashed by the test", {}};
  if (injected == Fault::kBeforeHandler) {
    host.End();
    return crashed;
  }
  host.injected = injected;
  std::optional<Error> failure = host.Handle(*item.message, item.sender);
  host.injected = Fault::kNone;
  TraceRecord record;
  record.time = now_.time_since_epoch().count();
  record.kind = failure ? proto::TRACE_FAILED : proto::TRACE_HANDLED;
  record.actor = host.trace_name;
  record.body = static_cast<std::uint16_t>(item.message->body_case());
  record.other_agent = item.message->hop_sender();
  record.bytes = static_cast<std::uint32_t>(item.bytes);
  record.request_id = item.message->request_id();
  host.agent.trace.Add(record);
  if (failure || injected == Fault::kNone) return failure;
  host.End();
  return crashed;
}

SimulatedTeam::Impl::Host* SimulatedTeam::Impl::FindHost(Agent& agent, const std::string& actor) {
  for (const auto& host : agent.hosts) {
    if (host->self().actor == actor) return host.get();
  }
  return nullptr;
}

TimerId SimulatedTeam::Impl::StartTimer(Host& host, Duration delay, proto::Message message) {
  WriteLocalEnvelope(host.self().agent, host.self().agent, message);
  const Address* sender = &*senders_.insert(host.self()).first;
  return events_.Add(now_ + std::max(delay, Duration::zero()),
                     [this, &agent = host.agent, life = host.life, &host, incarnation = host.incarnation(), sender,
                      message = std::move(message)] {
                       if (agent.life != life) return;
                       Mailbox::Item item;
                       item.message = proto::Message(message);
                       item.sender = sender;
                       item.is_timer = true;
                       item.incarnation = incarnation;
                       (void)host.mailbox.Push(std::move(item));
                       ScheduleStep(host);
                     });
}

void SimulatedTeam::Impl::Tell(Agent& agent, AgentId peer, bool is_connected) {
  if (agent.is_running) Notify(agent, agent.monitors.OnPeerChanged(peer, is_connected));
}

void SimulatedTeam::Impl::Notify(Agent& agent, Monitors::Notices notices) {
  for (Monitors::Notice& notice : notices) {
    (void)HandOver({agent.id, notice.watcher}, std::move(notice.message), /*sender=*/nullptr);
  }
}

void SimulatedTeam::Impl::Crash(Agent& agent) {
  if (!agent.is_running) return;
  agent.is_running = false;
  ++agent.life;
  agent.crashed = now_;
  radio_.ClearOutbox(agent.id);
  for (auto host = agent.hosts.rbegin(); host != agent.hosts.rend(); ++host) {
    (*host)->mailbox.Close();
    if (!(*host)->is_in_handler()) (*host)->End();  // Else SettleHandler ends it.
  }
}

void SimulatedTeam::Impl::Restart(Agent& agent) {
  Check(!agent.is_running, "only a crashed agent is restarted");
  for (const auto& host : agent.hosts) Check(!host->is_in_handler(), "no handler restarts its own agent");
  agent.hosts.clear();
  agent.is_running = true;
  agent.started = now_;
  agent.roles.SetRoles(agent.given_roles);
  agent.peers.clear();
  agent.monitors = Monitors(agent.id);
  Connect(agent);
  // All mailboxes exist before the first OnStart sends.
  for (const SpawnedActor& spawned : agent.spawned) MakeHost(agent, spawned);
  for (const auto& host : agent.hosts) {
    if (host->is_alive()) StartHost(*host);
  }
}

// --- Messages ---

SendResult SimulatedTeam::Impl::Post(const Address& from, const Address& to, proto::Message message) {
  const auto sender = agents_.find(from.agent);
  if (sender != agents_.end() && !sender->second->is_running) return SendResult::kUnreachable;
  return Send(from, to, std::move(message));
}

SendResult SimulatedTeam::Impl::Send(const Address& from, const Address& to, proto::Message message) {
  const auto sender = agents_.find(from.agent);
  Address resolved = to;
  if (sender != agents_.end()) resolved.agent = sender->second->roles.Resolve(to.agent);
  const auto recorded = sent_.find(from);
  if (recorded == sent_.end() || sent_count_ >= kKeptMax) return Route(from, resolved, std::move(message));
  proto::Message copy = message;
  WriteEnvelope(from, resolved, copy);
  const SendResult result = Route(from, resolved, std::move(message));
  if (result == SendResult::kAccepted) {
    recorded->second.push_back(std::move(copy));
    ++sent_count_;
  }
  return result;
}

SendResult SimulatedTeam::Impl::Route(const Address& from, const Address& resolved, proto::Message&& message) {
  if (resolved.agent != kClients && !agents_.contains(resolved.agent)) return SendResult::kNoPeer;
  // A client is on its agent's own machine.
  const bool is_local = from.agent == kClients || resolved.agent == kClients || from.agent == resolved.agent;
  if (is_local) {
    WriteLocalEnvelope(from.agent, resolved.agent, message);
    return HandOver(resolved, std::move(message), &*senders_.insert(from).first);
  }
  WriteEnvelope(from, resolved, message);
  return Transmit(from, resolved, message);
}

SendResult SimulatedTeam::Impl::HandOver(const Address& to, OwnedMessage message, const Address* sender) {
  const auto found = agents_.find(to.agent);
  if (found != agents_.end()) {
    Agent& agent = *found->second;
    if (!agent.is_running) return SendResult::kUnreachable;
    if (Host* host = FindHost(agent, to.actor)) {
      Mailbox::Item item;
      item.bytes = message->ByteSizeLong();
      item.message = std::move(message);
      item.sender = sender;
      const SendResult result = host->mailbox.Push(std::move(item)).result;
      if (result == SendResult::kAccepted) ScheduleStep(*host);
      return result;
    }
  }
  proto::Message kept = std::move(*message);
  if (sender != nullptr) WriteEnvelope(*sender, to, kept);
  events_.Add(now_, [this, to, kept = std::move(kept)] { Keep(to, kept); });
  return SendResult::kAccepted;
}

SendResult SimulatedTeam::Impl::Transmit(const Address& from, const Address& to, const proto::Message& message) {
  std::string bytes = message.SerializeAsString();
  const SimulatedRadio::Flight flight = radio_.Transmit(from.agent, to.agent, bytes.size(), now_);
  if (flight.result != SendResult::kAccepted) return flight.result;
  const auto sender = agents_.find(from.agent);
  if (sender != agents_.end()) {
    PeerCounters& counters = sender->second->peers[to.agent];
    ++counters.sent_messages;
    counters.sent_bytes += bytes.size();
  }
  if (filter && !filter(from.agent, to.agent, message)) return SendResult::kAccepted;
  const Agent* sender_agent = sender == agents_.end() ? nullptr : sender->second.get();
  const Agent& receiver = Find(to.agent);
  const auto shared = std::make_shared<const std::string>(std::move(bytes));
  for (const MonotonicTime arrival : flight.arrivals) {
    events_.Add(arrival, [this, from = from.agent, &receiver, life = receiver.life, sender_agent,
                          sender_life = sender_agent ? sender_agent->life : 0, departure = flight.departure, shared] {
      const bool has_left = !sender_agent || sender_agent->life == sender_life || departure <= sender_agent->crashed;
      if (has_left && receiver.life == life && receiver.is_running) Arrive(from, receiver.id, *shared);
    });
  }
  return SendResult::kAccepted;
}

void SimulatedTeam::Impl::Arrive(AgentId from, AgentId to, const std::string& bytes) {
  if (!radio_.is_up(from, to)) return;
  PeerCounters& counters = Find(to).peers[from];
  ++counters.received_messages;
  counters.received_bytes += bytes.size();
  counters.heard = now_;
  OwnedMessage message;
  Check(message->ParseFromString(bytes), "what was serialised can be parsed");
  const std::string actor = message->destination_actor();
  trace_hash_ = XXH64(bytes.data(), bytes.size(), trace_hash_);
  (void)HandOver({to, actor}, std::move(message), /*sender=*/nullptr);  // Full: counted by the mailbox.
}

void SimulatedTeam::Impl::Keep(const Address& address, const proto::Message& message) {
  Trace(address, SenderOf(message), message);
  if (kept_count_ >= kKeptMax) return;
  ++kept_count_;
  kept_[address].push_back(message);
}

void SimulatedTeam::Impl::Watch(const Address& actor, Topic topic) {
  Agent& agent = Find(actor.agent);
  Notify(agent, agent.monitors.Watch(actor.actor, topic));
}

std::vector<proto::Message> SimulatedTeam::Impl::Take(const Address& address) {
  std::vector<proto::Message> messages = std::exchange(kept_[address], {});
  kept_count_ -= messages.size();
  return messages;
}

void SimulatedTeam::Impl::Trace(const Address& to, const Address& sender, const proto::Message& message) {
  // Bodies count where they cross the radio (Arrive): between an agent's own actors they may hold what no seed rules,
  // such as a file's size or a solver's seconds.
  const std::string line = std::to_string(Duration(now_.time_since_epoch()).count()) + " " + ToString(sender) + " " +
                           ToString(to) + " " + std::to_string(message.body_case()) + " " +
                           std::to_string(message.request_id());
  trace_hash_ = XXH64(line.data(), line.size(), trace_hash_);
}

std::vector<proto::Message> SimulatedTeam::Impl::TakeSent(const Address& actor) {
  const auto recorded = sent_.find(actor);
  Check(recorded != sent_.end(), "RecordSent was called for the actor before");
  std::vector<proto::Message> messages = std::exchange(recorded->second, {});
  sent_count_ -= messages.size();
  return messages;
}

std::optional<proto::Message> SimulatedTeam::Impl::Expect(const Address& probe, proto::Message::BodyCase body,
                                                          Duration limit) {
  std::vector<proto::Message>& kept = kept_[probe];
  const auto find = [&] {
    return std::find_if(kept.begin(), kept.end(), [&](const proto::Message& m) { return m.body_case() == body; });
  };
  if (!RunUntil([&] { return find() != kept.end(); }, limit)) return std::nullopt;
  const auto found = find();
  proto::Message message = std::move(*found);
  kept_count_ -= static_cast<std::size_t>(found - kept.begin()) + 1;
  kept.erase(kept.begin(), found + 1);
  return message;
}

// --- Time ---

bool SimulatedTeam::Impl::RunNextEvent(MonotonicTime end) {
  auto due = events_.TakeDue(end);
  if (!due) return false;
  if (due->first > now_) {
    now_ = due->first;
    events_at_now_ = 0;
  }
  Check(++events_at_now_ <= kEventsAtOnceMax, "actors come to rest while time stands still");
  due->second();
  return true;
}

void SimulatedTeam::Impl::RunEventsUntil(MonotonicTime end) {
  while (RunNextEvent(end)) {
  }
}

void SimulatedTeam::Impl::RunUntilIdle() {
  events_at_now_ = 0;
  RunEventsUntil(now_);
}

void SimulatedTeam::Impl::AdvanceTime(Duration duration) {
  Check(duration >= Duration::zero(), "time does not go backwards");
  const MonotonicTime end = now_ + duration;
  RunEventsUntil(end);
  if (end > now_) events_at_now_ = 0;
  now_ = end;
}

bool SimulatedTeam::Impl::RunUntil(const std::function<bool()>& condition, Duration limit) {
  const MonotonicTime end = now_ + limit;
  while (!condition()) {
    if (!RunNextEvent(end)) {
      if (events_.NextDue()) AdvanceTime(end - now_);
      return false;
    }
  }
  return true;
}

// --- Status ---

SystemStatus SimulatedTeam::Impl::StatusOf(const Agent& agent) const {
  SystemStatus status;
  status.uptime = now_ - agent.started;
  for (const auto& host : agent.hosts) {
    proto::ActorStatus& actor = status.actors.emplace_back();
    actor.set_name(host->self().actor);
    actor.set_handled(static_cast<double>(host->handled()));
    const Mailbox::Counts counts = host->mailbox.counts();
    actor.set_queued(static_cast<double>(counts.waiting));
    actor.set_queued_max(static_cast<double>(counts.waiting_max));
    actor.set_dropped(static_cast<double>(counts.dropped));
    actor.set_restarts(static_cast<double>(host->restarts));
  }
  for (const auto& [id, other] : agents_) {
    if (id == agent.id) continue;
    proto::PeerStatus& peer = status.peers.emplace_back();
    peer.set_agent_id(id);
    peer.set_is_connected(radio_.is_up(agent.id, id));
    peer.set_seconds_since_heard(-1);
    const auto found = agent.peers.find(id);
    if (found == agent.peers.end()) continue;
    const PeerCounters& counters = found->second;
    if (counters.heard) {
      peer.set_seconds_since_heard(std::chrono::duration<double>(now_ - *counters.heard).count());
    }
    peer.set_sent_messages(static_cast<double>(counters.sent_messages));
    peer.set_sent_bytes(static_cast<double>(counters.sent_bytes));
    peer.set_received_messages(static_cast<double>(counters.received_messages));
    peer.set_received_bytes(static_cast<double>(counters.received_bytes));
  }
  return status;
}

proto::TraceReply SimulatedTeam::Impl::TraceOf(const Agent& agent, const proto::TraceRequest& request) const {
  proto::TraceReply reply;
  agent.trace.Report(request, now_.time_since_epoch().count(), &reply);
  agent.dead_letters.Report(request, now_, &reply);
  return reply;
}

// --- SimulatedTeam ---

SimulatedTeam::SimulatedTeam(std::uint64_t seed) : impl_(std::make_unique<Impl>(seed)) {}
SimulatedTeam::~SimulatedTeam() = default;

void SimulatedTeam::AddAgent(AgentId agent) { impl_->AddAgent(agent); }
void SimulatedTeam::SetBaseStation(AgentId agent) { impl_->SetBaseStation(agent); }
void SimulatedTeam::SetRoles(AgentId agent, const proto::RoleAssignment& roles) { impl_->SetRoles(agent, roles); }
void SimulatedTeam::Spawn(AgentId agent, std::string name, ActorFactory factory, SpawnOptions options) {
  impl_->Spawn(agent, {std::move(name), std::move(factory), std::move(options)});
}
SendResult SimulatedTeam::Post(const Address& from, const Address& to, proto::Message message) {
  return impl_->Post(from, to, std::move(message));
}
std::optional<proto::Message> SimulatedTeam::Expect(const Address& probe, proto::Message::BodyCase body,
                                                    Duration limit) {
  return impl_->Expect(probe, body, limit);
}
void SimulatedTeam::RecordSent(const Address& actor) { impl_->RecordSent(actor); }
void SimulatedTeam::Watch(const Address& actor, Topic topic) { impl_->Watch(actor, topic); }
std::vector<proto::Message> SimulatedTeam::TakeSent(const Address& actor) { return impl_->TakeSent(actor); }
void SimulatedTeam::CrashActor(const Address& actor) { impl_->CrashActor(actor); }
void SimulatedTeam::SetFault(std::function<Fault(const Address&, const proto::Message&)> fault) {
  impl_->fault = std::move(fault);
}
void SimulatedTeam::Partition(const std::vector<std::vector<AgentId>>& groups) { impl_->Partition(groups); }
std::vector<proto::Message> SimulatedTeam::Take(const Address& address) { return impl_->Take(address); }
void SimulatedTeam::RunUntilIdle() { impl_->RunUntilIdle(); }
void SimulatedTeam::AdvanceTime(Duration duration) { impl_->AdvanceTime(duration); }
bool SimulatedTeam::RunUntil(const std::function<bool()>& condition, Duration limit) {
  return impl_->RunUntil(condition, limit);
}
MonotonicTime SimulatedTeam::now() const { return impl_->now(); }
std::int64_t SimulatedTeam::utc_now_ns() const { return impl_->utc_now_ns(); }
void SimulatedTeam::SetUtcOffset(AgentId agent, Duration offset) { impl_->Find(agent).utc_offset = offset; }
void SimulatedTeam::Crash(AgentId agent) { impl_->Crash(impl_->Find(agent)); }
void SimulatedTeam::Restart(AgentId agent) { impl_->Restart(impl_->Find(agent)); }
bool SimulatedTeam::is_running(AgentId agent) const { return impl_->Find(agent).is_running; }
RadioOptions& SimulatedTeam::radio() { return impl_->radio().options(); }
void SimulatedTeam::SetLink(AgentId a, AgentId b, bool is_up, bool tell) { impl_->SetLink(a, b, is_up, tell); }
void SimulatedTeam::SetFilter(std::function<bool(AgentId, AgentId, const proto::Message&)> filter) {
  impl_->filter = std::move(filter);
}
std::uint64_t SimulatedTeam::radio_bytes() const { return impl_->radio().bytes(); }
std::uint64_t SimulatedTeam::restarts(AgentId agent) const { return impl_->Find(agent).restarts; }
std::uint64_t SimulatedTeam::trace_hash() const { return impl_->trace_hash(); }
SystemStatus SimulatedTeam::GetSystemStatus(AgentId agent) const { return impl_->StatusOf(impl_->Find(agent)); }
proto::TraceReply SimulatedTeam::GetTrace(AgentId agent, const proto::TraceRequest& request) const {
  return impl_->TraceOf(impl_->Find(agent), request);
}

}  // namespace moondb::simulation
