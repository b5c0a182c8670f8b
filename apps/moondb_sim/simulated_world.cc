#include "apps/moondb_sim/simulated_world.h"

#include <array>
#include <cstdio>
#include <utility>
#include <vector>

namespace moondb::simulation {
namespace {

constexpr std::size_t kViolationsMax = 10;
constexpr std::size_t kLastEvents = 60;

// One seed in three has a survivor that takes the lead by itself.
constexpr std::uint64_t kFailoverEvery = 3;
constexpr double kLeaderTimeout_s = 120;

constexpr std::uint64_t kStatesEvery = 2;  // Seeds: their agents send states unasked.
constexpr double kStatesPeriod_s = 300;

constexpr std::uint64_t kKeepsAllEvery = 2;  // Seeds: superseded states go for want of room alone.
constexpr double kHistory_mb = 0.02;

// Seeds, from the first on, whose agents code compactly: half of a run's time goes there. The others send zstd.
constexpr std::uint64_t kCompactEvery = 4;

proto::TeamConfig MakeTeam(const SimOptions& options) {
  proto::TeamConfig team;
  team.set_team("simulated");
  for (int id = 1; id <= options.rovers + 1; ++id) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(static_cast<std::uint32_t>(id));
    const bool is_base = id == options.rovers + 1;
    agent.set_name(is_base ? "base" : "rover" + std::to_string(id));
    agent.set_kind(is_base ? proto::AGENT_KIND_BASE_STATION : proto::AGENT_KIND_ROVER);
  }
  team.mutable_roles()->set_leader("rover1");
  team.mutable_roles()->set_survivor("rover2");
  if (options.seed % kFailoverEvery == 0) team.mutable_roles()->set_failover(proto::FAILOVER_AUTOMATIC);
  team.mutable_roles()->set_leader_timeout_s(kLeaderTimeout_s);
  team.mutable_radio()->set_quiet_while_driving(true);
  if (options.is_paced) team.mutable_radio()->set_budget_kbps(options.BudgetKbps());
  team.mutable_radio()->set_codec(options.seed % kCompactEvery == 1 ? proto::CODEC_COMPACT : proto::CODEC_ZSTD);
  if (options.seed % kStatesEvery == 0) team.mutable_radio()->set_states_period_s(kStatesPeriod_s);
  auto& share = *team.mutable_share();
  share["power"] = proto::POLICY_LATEST;
  share["pose_graph_node"] = proto::POLICY_ALL;
  share["optimized_pose"] = proto::POLICY_LATEST;
  share["local_traversability_map"] = proto::POLICY_ALL;
  share["map_quarantine"] = proto::POLICY_ALL;
  proto::CustomType& beacon = *team.add_custom_types();
  beacon.set_id(kBeacon);
  beacon.set_name("beacon");
  beacon.set_share(proto::POLICY_LATEST);
  beacon.set_ground(proto::POLICY_LATEST);
  beacon.set_priority(5);
  beacon.set_bytes_max(64);
  // Enough for some minutes of states, so that the oldest go all the time.
  team.mutable_retention()->set_history_mb_max(kHistory_mb);
  (*team.mutable_keep())["power"] = options.seed % kKeepsAllEvery == 0 ? "all" : "30m";
  (*team.mutable_keep())["optimized_pose"] = "1h";
  (*team.mutable_ground())["power"] = proto::POLICY_LATEST;
  (*team.mutable_ground())["pose_graph_node"] = proto::POLICY_ALL;
  (*team.mutable_ground())["local_traversability_map"] = proto::POLICY_ALL;
  (*team.mutable_ground())["map_quarantine"] = proto::POLICY_ALL;
  return team;
}

}  // namespace

SimulatedWorld::SimulatedWorld(const SimOptions& sim_options)
    : options(sim_options),
      config(MakeTeam(sim_options)),
      base(static_cast<AgentId>(sim_options.rovers + 1)),
      rng(sim_options.seed),
      disk(sim_options.seed),
      rules([this](const std::string& rule, std::string text) { Violate(rule, std::move(text)); }),
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

void SimulatedWorld::NoteEvent(const Address& actor, const proto::Message& message) {
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

proto::Message SimulatedWorld::AskActor(AgentId agent, const char* actor, proto::Message question) {
  const Address asker{agent, "checker"};
  (void)team.Take(asker);
  is_asking = true;
  (void)team.Post(asker, {agent, actor}, std::move(question));
  team.RunUntilIdle();
  is_asking = false;
  std::vector<proto::Message> answers = team.Take(asker);
  return answers.empty() ? proto::Message() : std::move(answers.back());
}

std::optional<HaveSet> SimulatedWorld::HaveOf(AgentId agent) {
  proto::Message question;
  question.mutable_have_request();
  const proto::Message answer = AskActor(agent, actor_name::kStorage, std::move(question));
  if (!answer.has_have_reply()) return std::nullopt;
  return *FromProto(answer.have_reply().have());
}

}  // namespace moondb::simulation
