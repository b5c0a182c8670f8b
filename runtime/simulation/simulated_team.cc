#include "runtime/simulation/simulated_team.h"

#include <xxhash.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "model/check.h"
#include "runtime/envelope.h"
#include "runtime/simulation/simulated_agent.h"
#include "runtime/system_status.h"
#include "runtime/timer_queue.h"
#include "runtime/transport.h"

namespace moondb::simulation {
namespace {

constexpr std::int64_t kUtcStart_ns = 1'767'225'600'000'000'000;  // UTC at the start of a run: 2026-01-01.
// Not zero, so that a time that was never set differs from the start of the run.
constexpr MonotonicTime kStart(std::chrono::seconds(1000));
constexpr std::size_t kKeptMax = 100'000;
constexpr std::uint64_t kEventsAtOnceMax = 1'000'000;

}  // namespace

class SimulatedTeam::Impl final : public AgentSurroundings {
 public:
  explicit Impl(std::uint64_t seed) : seed_(seed), radio_(seed) {}
  ~Impl() override;

  void AddAgent(AgentId id);
  void SetBaseStation(AgentId base_station);
  SendResult Post(const Address& from, const Address& to, proto::Message message);
  std::vector<proto::Message> TakeMessages(const Address& address);
  void RunUntilIdle();
  void AdvanceTime(Duration duration);
  bool RunUntil(const std::function<bool()>& condition, Duration limit);
  void Restart(AgentId id);
  void SetLink(AgentId a, AgentId b, bool is_up, bool tell);
  void Partition(const std::vector<std::vector<AgentId>>& groups);
  std::optional<proto::Message> Expect(const Address& probe, proto::Message::BodyCase body, Duration limit);
  void RecordSent(const Address& actor) { sent_[actor]; }
  std::vector<proto::Message> TakeSent(const Address& actor);

  SimulatedAgent& Find(AgentId id);

  MonotonicTime now() const override { return now_; }
  std::int64_t utc_now_ns() const override { return kUtcStart_ns + Duration(now_ - kStart).count(); }

  SimulatedRadio& radio() { return radio_; }
  std::uint64_t trace_hash() const { return trace_hash_; }

  std::function<bool(AgentId, AgentId, const proto::Message&)> filter;
  std::function<Fault(const Address&, const proto::Message&)> fault;

 private:
  // Implementation of AgentSurroundings.
  TimerQueue<Event>& events() override { return events_; }
  SendResult Send(const Address& from, const Address& to, proto::Message message) override;
  SendResult HandOver(const Address& to, OwnedMessage message, const Address* sender) override;
  const Address* Remember(const Address& sender) override { return &*senders_.insert(sender).first; }
  Fault FaultFor(const Address& actor, const proto::Message& message) override {
    return fault ? fault(actor, message) : Fault::kNone;
  }
  void Trace(const Address& to, const Address& sender, const proto::Message& message) override;
  std::vector<proto::PeerStatus> PeersOf(const SimulatedAgent& agent) const override;
  void OnCrashed(AgentId agent) override { radio_.ClearOutbox(agent); }

  std::vector<AgentId> ConnectedTo(AgentId id) const;
  SendResult Route(const Address& from, const Address& resolved, proto::Message&& message);
  SendResult Transmit(const Address& from, const Address& to, const proto::Message& message);
  void Arrive(AgentId from, AgentId to, const std::string& bytes);
  void Keep(const Address& address, const proto::Message& message);

  bool RunNextEvent(MonotonicTime end);
  void RunEventsUntil(MonotonicTime end);

  const std::uint64_t seed_;
  MonotonicTime now_ = kStart;
  TimerQueue<Event> events_;
  std::uint64_t events_at_now_ = 0;
  SimulatedRadio radio_;
  AgentId base_station_ = 0;
  std::map<AgentId, std::unique_ptr<SimulatedAgent>> agents_;
  std::map<Address, std::vector<proto::Message>> kept_;
  std::size_t kept_count_ = 0;
  std::set<Address> senders_;  // Senders of local messages. Never erased, because a waiting message may point to one.
  std::map<Address, std::vector<proto::Message>> sent_;  // Recorded messages by sender.
  std::size_t sent_count_ = 0;
  std::uint64_t trace_hash_ = 0;
};

SimulatedTeam::Impl::~Impl() {
  for (const auto& [id, agent] : agents_) agent->Crash();
}

// --- The team ---

SimulatedAgent& SimulatedTeam::Impl::Find(AgentId id) {
  const auto found = agents_.find(id);
  Check(found != agents_.end(), "the agent was added");
  return *found->second;
}

void SimulatedTeam::Impl::AddAgent(AgentId id) {
  Check(id >= 1 && id <= kAgentIdMax, "an agent's id is from 1 to 65535");
  const auto [added, is_new] = agents_.emplace(id, std::make_unique<SimulatedAgent>(*this, id, seed_));
  Check(is_new, "an agent is added once");
  added->second->SetBaseStation(base_station_);
  for (const AgentId peer : ConnectedTo(id)) {
    added->second->OnPeerAtStart(peer);
    Find(peer).OnPeerChanged(id, true);
  }
}

std::vector<AgentId> SimulatedTeam::Impl::ConnectedTo(AgentId id) const {
  std::vector<AgentId> connected;
  for (const auto& [other, agent] : agents_) {
    if (other != id && radio_.is_up(id, other)) connected.push_back(other);
  }
  return connected;
}

void SimulatedTeam::Impl::Restart(AgentId id) { Find(id).Restart(ConnectedTo(id)); }

void SimulatedTeam::Impl::SetBaseStation(AgentId base_station) {
  base_station_ = base_station;
  for (const auto& [id, agent] : agents_) agent->SetBaseStation(base_station);
}

void SimulatedTeam::Impl::SetLink(AgentId a, AgentId b, bool is_up, bool tell) {
  radio_.SetLink(a, b, is_up, tell);
  if (!tell) return;
  for (const auto& [end, peer] : {std::pair(a, b), std::pair(b, a)}) {
    if (agents_.contains(end)) Find(end).OnPeerChanged(peer, is_up);
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

// --- Messages ---

SendResult SimulatedTeam::Impl::Post(const Address& from, const Address& to, proto::Message message) {
  const auto sender = agents_.find(from.agent);
  if (sender != agents_.end() && !sender->second->is_running()) return SendResult::kUnreachable;
  return Send(from, to, std::move(message));
}

SendResult SimulatedTeam::Impl::Send(const Address& from, const Address& to, proto::Message message) {
  const auto sender = agents_.find(from.agent);
  Address resolved = to;
  if (sender != agents_.end()) resolved.agent = sender->second->Resolve(to.agent);
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
  // A client runs on the same machine as its agent, so its messages do not cross the radio.
  const bool is_local = from.agent == kClients || resolved.agent == kClients || from.agent == resolved.agent;
  if (is_local) {
    WriteLocalEnvelope(from.agent, resolved.agent, message);
    return HandOver(resolved, std::move(message), Remember(from));
  }
  WriteEnvelope(from, resolved, message);
  return Transmit(from, resolved, message);
}

SendResult SimulatedTeam::Impl::HandOver(const Address& to, OwnedMessage message, const Address* sender) {
  const auto found = agents_.find(to.agent);
  if (found != agents_.end()) {
    if (!found->second->is_running()) return SendResult::kUnreachable;
    if (const auto pushed = found->second->Push(to.actor, message, sender)) return *pushed;
  }
  proto::Message kept = std::move(*message);
  if (sender != nullptr) WriteEnvelope(*sender, to, kept);
  events_.Add(now_, [this, to, kept = std::move(kept)] { Keep(to, kept); });
  return SendResult::kAccepted;
}

SendResult SimulatedTeam::Impl::Transmit(const Address& from, const Address& to, const proto::Message& message) {
  std::string bytes = message.SerializeAsString();
  if (bytes.size() > kPeerMessageBytesMax) return SendResult::kTooLong;
  const SimulatedRadio::Flight flight = radio_.Transmit(from.agent, to.agent, bytes.size(), now_);
  if (flight.result != SendResult::kAccepted) return flight.result;
  const auto sender = agents_.find(from.agent);
  if (sender != agents_.end()) {
    SimulatedAgent::PeerCounters& counters = sender->second->peers()[to.agent];
    ++counters.sent_messages;
    counters.sent_bytes += bytes.size();
  }
  if (filter && !filter(from.agent, to.agent, message)) return SendResult::kAccepted;
  const SimulatedAgent* sender_agent = sender == agents_.end() ? nullptr : sender->second.get();
  const SimulatedAgent& receiver = Find(to.agent);
  const auto shared = std::make_shared<const std::string>(std::move(bytes));
  for (const MonotonicTime arrival : flight.arrivals) {
    events_.Add(arrival, [this, from = from.agent, &receiver, boot = receiver.boot(), sender_agent,
                          sender_boot = sender_agent ? sender_agent->boot() : 0, departure = flight.departure, shared] {
      const bool has_left =
          !sender_agent || sender_agent->boot() == sender_boot || departure <= sender_agent->crashed();
      if (has_left && receiver.boot() == boot && receiver.is_running()) Arrive(from, receiver.id(), *shared);
    });
  }
  return SendResult::kAccepted;
}

void SimulatedTeam::Impl::Arrive(AgentId from, AgentId to, const std::string& bytes) {
  if (!radio_.is_up(from, to)) return;
  SimulatedAgent::PeerCounters& counters = Find(to).peers()[from];
  ++counters.received_messages;
  counters.received_bytes += bytes.size();
  counters.heard = now_;
  OwnedMessage message;
  Check(message->ParseFromString(bytes), "what was serialised can be parsed");
  const std::string actor = message->destination_actor();
  trace_hash_ = XXH64(bytes.data(), bytes.size(), trace_hash_);
  // Ignore kFull: the mailbox has already counted the dropped message.
  (void)HandOver({to, actor}, std::move(message), /*sender=*/nullptr);
}

void SimulatedTeam::Impl::Keep(const Address& address, const proto::Message& message) {
  Trace(address, SenderOf(message), message);
  if (kept_count_ >= kKeptMax) return;
  ++kept_count_;
  kept_[address].push_back(message);
}

std::vector<proto::Message> SimulatedTeam::Impl::TakeMessages(const Address& address) {
  std::vector<proto::Message> messages = std::exchange(kept_[address], {});
  kept_count_ -= messages.size();
  return messages;
}

void SimulatedTeam::Impl::Trace(const Address& to, const Address& sender, const proto::Message& message) {
  // Do not hash the body here. Messages between agents are hashed by Arrive. Messages between an agent's own actors may
  // hold values that the seed does not determine, such as a file's size or a solver's time.
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
  Check(++events_at_now_ <= kEventsAtOnceMax, "actors become idle at one instant");
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

std::vector<proto::PeerStatus> SimulatedTeam::Impl::PeersOf(const SimulatedAgent& agent) const {
  std::vector<proto::PeerStatus> statuses;
  for (const auto& [id, other] : agents_) {
    if (id == agent.id()) continue;
    proto::PeerStatus& peer = statuses.emplace_back();
    peer.set_agent_id(id);
    peer.set_is_connected(radio_.is_up(agent.id(), id));
    peer.set_seconds_since_heard(-1);
    const auto found = agent.peers().find(id);
    if (found == agent.peers().end()) continue;
    const SimulatedAgent::PeerCounters& counters = found->second;
    if (counters.heard) {
      peer.set_seconds_since_heard(std::chrono::duration<double>(now_ - *counters.heard).count());
    }
    peer.set_sent_messages(static_cast<double>(counters.sent_messages));
    peer.set_sent_bytes(static_cast<double>(counters.sent_bytes));
    peer.set_received_messages(static_cast<double>(counters.received_messages));
    peer.set_received_bytes(static_cast<double>(counters.received_bytes));
  }
  return statuses;
}

// --- SimulatedTeam ---

SimulatedTeam::SimulatedTeam(std::uint64_t seed) : impl_(std::make_unique<Impl>(seed)) {}
SimulatedTeam::~SimulatedTeam() = default;

void SimulatedTeam::AddAgent(AgentId agent) { impl_->AddAgent(agent); }
void SimulatedTeam::SetBaseStation(AgentId agent) { impl_->SetBaseStation(agent); }
void SimulatedTeam::SetRoles(AgentId agent, const proto::RoleAssignment& roles) { impl_->Find(agent).SetRoles(roles); }
void SimulatedTeam::Spawn(AgentId agent, std::string name, ActorFactory factory, SpawnOptions options) {
  impl_->Find(agent).Spawn({std::move(name), std::move(factory), std::move(options)});
}
SendResult SimulatedTeam::Post(const Address& from, const Address& to, proto::Message message) {
  return impl_->Post(from, to, std::move(message));
}
std::optional<proto::Message> SimulatedTeam::Expect(const Address& probe, proto::Message::BodyCase body,
                                                    Duration limit) {
  return impl_->Expect(probe, body, limit);
}
void SimulatedTeam::RecordSent(const Address& actor) { impl_->RecordSent(actor); }
void SimulatedTeam::Watch(const Address& actor, Topic topic) { impl_->Find(actor.agent).Watch(actor.actor, topic); }
std::vector<proto::Message> SimulatedTeam::TakeSent(const Address& actor) { return impl_->TakeSent(actor); }
void SimulatedTeam::CrashActor(const Address& actor) { impl_->Find(actor.agent).CrashActor(actor.actor); }
void SimulatedTeam::SetFault(std::function<Fault(const Address&, const proto::Message&)> fault) {
  impl_->fault = std::move(fault);
}
void SimulatedTeam::Partition(const std::vector<std::vector<AgentId>>& groups) { impl_->Partition(groups); }
std::vector<proto::Message> SimulatedTeam::TakeMessages(const Address& address) { return impl_->TakeMessages(address); }
void SimulatedTeam::RunUntilIdle() { impl_->RunUntilIdle(); }
void SimulatedTeam::AdvanceTime(Duration duration) { impl_->AdvanceTime(duration); }
bool SimulatedTeam::RunUntil(const std::function<bool()>& condition, Duration limit) {
  return impl_->RunUntil(condition, limit);
}
MonotonicTime SimulatedTeam::now() const { return impl_->now(); }
std::int64_t SimulatedTeam::utc_now_ns() const { return impl_->utc_now_ns(); }
void SimulatedTeam::SetUtcOffset(AgentId agent, Duration offset) { impl_->Find(agent).SetUtcOffset(offset); }
void SimulatedTeam::Crash(AgentId agent) { impl_->Find(agent).Crash(); }
void SimulatedTeam::Restart(AgentId agent) { impl_->Restart(agent); }
bool SimulatedTeam::is_running(AgentId agent) const { return impl_->Find(agent).is_running(); }
RadioOptions& SimulatedTeam::radio() { return impl_->radio().options(); }
void SimulatedTeam::SetLink(AgentId a, AgentId b, bool is_up, bool tell) { impl_->SetLink(a, b, is_up, tell); }
void SimulatedTeam::SetFilter(std::function<bool(AgentId, AgentId, const proto::Message&)> filter) {
  impl_->filter = std::move(filter);
}
std::uint64_t SimulatedTeam::radio_bytes() const { return impl_->radio().bytes(); }
std::uint64_t SimulatedTeam::restarts(AgentId agent) const { return impl_->Find(agent).restarts(); }
std::uint64_t SimulatedTeam::trace_hash() const { return impl_->trace_hash(); }
SystemStatus SimulatedTeam::GetSystemStatus(AgentId agent) const { return impl_->Find(agent).Status(); }
proto::TraceReply SimulatedTeam::GetTrace(AgentId agent, const proto::TraceRequest& request) const {
  return impl_->Find(agent).Trace(request);
}

}  // namespace moondb::simulation
