#include "apps/moondb_sim/simulated_world.h"

#include <array>
#include <cstdio>
#include <utility>
#include <vector>

#include "apps/moondb_sim/simulated_config.h"
#include "runtime/team/role_signature.h"

namespace moondb::simulation {
namespace {

constexpr std::size_t kViolationsMax = 10;
constexpr std::size_t kLastEvents = 60;
// After a prune, an agent must store records from kRefusedBefore until kStoresFor. Earlier, robots may still receive
// refusals from before the prune. Later, peers' records may have filled the freed space.
constexpr Duration kRefusedBefore = std::chrono::seconds(15);
constexpr Duration kStoresFor = std::chrono::seconds(75);

}  // namespace

SimulatedWorld::SimulatedWorld(const SimOptions& sim_options)
    : options(sim_options),
      config(MakeTeamConfig(sim_options)),
      config_with_all_notes(KeepAllNotes(config)),
      base(static_cast<AgentId>(sim_options.RoverCount() + 1)),
      byzantine(sim_options.Byzantine()),
      rng(sim_options.seed),
      disk(sim_options.seed),
      invariants([this](const std::string& rule, std::string text) { Violate(rule, std::move(text)); },
                 {.liar = byzantine, .base = base, .has_keys = HasSigningKeys(config)}),
      team(sim_options.seed) {}

std::string SimulatedWorld::Prefix(AgentId agent) { return "agent" + std::to_string(agent) + "/"; }

std::string SimulatedWorld::PathOf(AgentId agent) { return Prefix(agent) + "moondb.sqlite"; }

void SimulatedWorld::At(MonotonicTime time, Action action) { schedule.emplace(time, std::move(action)); }

void SimulatedWorld::In(Duration delay, Action action) { At(team.now() + delay, std::move(action)); }

void SimulatedWorld::AdvanceTo(MonotonicTime time) {
  if (time > team.now()) team.AdvanceTime(time - team.now());
}

double SimulatedWorld::NowS() const { return std::chrono::duration<double>(team.now() - start).count(); }

double SimulatedWorld::Draw() { return static_cast<double>(rng() >> 11) * 0x1.0p-53; }

Duration SimulatedWorld::DrawDuration(Duration limit) {
  return Duration(static_cast<Duration::rep>(Draw() * static_cast<double>(limit.count())));
}

AgentId SimulatedWorld::DrawAgent() { return 1 + static_cast<AgentId>(rng() % base); }

AgentId SimulatedWorld::DrawOther(AgentId agent) {
  return 1 + (agent + static_cast<AgentId>(rng() % (base - 1))) % base;
}

bool SimulatedWorld::HasEnough() const { return report.violations.size() >= kViolationsMax; }

void SimulatedWorld::AddEvent(const Address& actor, const proto::Message& message) {
  events_.push_back({NowS(), actor.actor, actor.agent, message.body_case(), message.hop_sender()});
  if (events_.size() > kLastEvents) events_.pop_front();
}

void SimulatedWorld::Violate(const std::string& rule, std::string text) {
  if (report.violations.empty()) {
    for (const Event& event : events_) {
      const auto* field = proto::Message::descriptor()->FindFieldByNumber(event.body);
      char line[160];
      std::snprintf(line, sizeof line, "%10.3f s  agent %u %s  %s  from agent %u", event.time_s, event.agent,
                    event.actor.c_str(), field == nullptr ? "nothing" : field->name().c_str(), event.from);
      report.last_events.push_back(line);
    }
  }
  if (HasEnough()) return;
  report.violations.push_back({rule, NowS(), report.messages, std::move(text)});
}

bool SimulatedWorld::MustStore(AgentId agent) const {
  const auto freed = freed_on_full_disk.find(agent);
  if (freed == freed_on_full_disk.end() || !freed->second.since) return false;
  const Duration passed = team.now() - *freed->second.since;
  return passed > kRefusedBefore && passed < kStoresFor;
}

bool SimulatedWorld::HadDiskTrouble(AgentId agent) const {
  const auto until = disk_trouble_until.find(agent);
  return until != disk_trouble_until.end() && team.now() < until->second + std::chrono::minutes(1);
}

std::set<AgentId> SimulatedWorld::Leaders() const {
  std::set<AgentId> leaders;
  for (const auto& [agent, its] : roles) {
    if (its.leader() == agent && team.is_running(agent)) leaders.insert(agent);
  }
  return leaders;
}

proto::Message SimulatedWorld::RequestActor(AgentId agent, const char* actor, proto::Message question) {
  const Address requester{agent, "checker"};
  (void)team.TakeMessages(requester);
  // Let gateways forward pending messages first. If the actor handled them after `question`, its answer could be
  // outdated.
  if (options.has_all_actors()) team.RunUntilIdle();
  is_asking = true;
  (void)team.Post(requester, {agent, actor}, std::move(question));
  team.RunUntilIdle();
  is_asking = false;
  std::vector<proto::Message> answers = team.TakeMessages(requester);
  return answers.empty() ? proto::Message() : std::move(answers.back());
}

std::optional<HaveSet> SimulatedWorld::HaveOf(AgentId agent) {
  proto::Message question;
  question.mutable_have_request();
  const proto::Message answer = RequestActor(agent, actor_name::kStorage, std::move(question));
  if (!answer.has_have_reply()) return std::nullopt;
  return *FromProto(answer.have_reply().have());
}

Records SimulatedWorld::ReadAll(AgentId agent) {
  Records records;
  for (std::uint64_t after = 0;;) {
    proto::Message question;
    question.mutable_read_request()->set_after_row_id(after);
    const proto::Message answer = RequestActor(agent, actor_name::kStorage, std::move(question));
    const proto::ReadReply& reply = answer.read_reply();
    for (const proto::StoredRecord& record : reply.records()) {
      invariants.ObserveRecord(FromProto(record.key()), record.content(), agent);
      if (record.key().seq() != 0) records[FromProto(record.key())] = record.content();
    }
    if (reply.is_complete() || reply.row_ids().empty()) return records;
    after = *reply.row_ids().rbegin();
  }
}

}  // namespace moondb::simulation
