#include "apps/moondb_view/timeline.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/common/json_writer.h"
#include "apps/moondb_view/team_page.h"
#include "model/agent_name.h"

namespace moondb {
namespace {

// Returns how many records of each origin an agent has or had, by its have-set.
std::map<AgentId, double> CountsByOrigin(const HaveSet& holds) {
  std::map<AgentId, double> counts;
  for (const auto& [stream, have] : holds.streams()) {
    counts[stream.origin] += static_cast<double>(have.Covered().Count());
  }
  return counts;
}

void WriteCurve(const char* name, const std::vector<std::optional<double>>& values, JsonWriter& json) {
  json.Key(name).BeginArray();
  for (const std::optional<double>& value : values) value ? json.Number(*value) : json.Null();
  json.EndArray();
}

}  // namespace

void Timeline::Add(double time_s, const std::map<AgentId, TimelineCounts>& counts) {
  // The first sample stays, as the last but one does.
  if (samples_.size() > 1 && time_s - samples_[samples_.size() - 2].time_s < period_s_) samples_.pop_back();
  samples_.push_back({time_s, counts});
  if (samples_.size() <= kSamplesMax) return;
  std::vector<Sample> half;
  for (std::size_t i = 0; i < samples_.size(); i += 2) half.push_back(std::move(samples_[i]));
  samples_ = std::move(half);
  period_s_ *= 2;
}

std::string Timeline::Json(const proto::TeamConfig& team) const {
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.left()) continue;
    json.BeginObject().Key("name").String(agent.name()).Key("time_s").BeginArray();
    for (const Sample& sample : samples_) json.Number(std::round(sample.time_s * 10) / 10);
    json.EndArray();
    for (const auto& [name, member] :
         {std::pair("created", &TimelineCounts::created), std::pair("leader", &TimelineCounts::leader),
          std::pair("survivor", &TimelineCounts::survivor), std::pair("ground", &TimelineCounts::ground)}) {
      std::vector<std::optional<double>> values;
      for (const Sample& sample : samples_) {
        const auto counts = sample.counts.find(agent.id());
        values.push_back(counts == sample.counts.end() ? std::nullopt : counts->second.*member);
      }
      WriteCurve(name, values, json);
    }
    json.EndObject();
  }
  return json.EndArray().EndObject().text();
}

std::map<AgentId, TimelineCounts> TimelineCountsOf(const proto::TeamConfig& team, const TeamReports& reports) {
  std::map<AgentId, TimelineCounts> all;
  const auto own = reports.agents.find(reports.agent);
  if (own == reports.agents.end() || !own->second.report.status) return all;
  const proto::AgentStatus& status = *own->second.report.status;
  std::map<AgentId, std::map<AgentId, double>> counts;  // By holder, then by origin.
  for (const auto& [agent, reported] : reports.agents) {
    if (reported.holds && reported.age_s <= kAnswerAgeMax_s) counts[agent] = CountsByOrigin(*reported.holds);
  }
  const auto held_by = [&](AgentId holder, AgentId origin) -> std::optional<double> {
    if (const auto known = counts.find(holder); known != counts.end()) return known->second[origin];
    if (origin != reports.agent || !counts.contains(reports.agent)) return std::nullopt;
    const auto& backlogs = status.storage().backlogs();
    const auto backlog = std::ranges::find(backlogs, holder, &proto::PeerBacklog::agent_id);
    if (backlog == backlogs.end()) return std::nullopt;
    return std::max(0.0, counts.at(reports.agent)[origin] - backlog->own_count());
  };
  const auto base = std::ranges::find(team.agents(), proto::AGENT_KIND_BASE_STATION, &proto::AgentConfig::kind);
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.left()) continue;
    TimelineCounts& of = all[agent.id()];
    of.created = held_by(agent.id(), agent.id());
    if (status.roles().leader() != 0) of.leader = held_by(status.roles().leader(), agent.id());
    if (status.roles().survivor() != 0) of.survivor = held_by(status.roles().survivor(), agent.id());
    if (base != team.agents().end()) of.ground = held_by(base->id(), agent.id());
  }
  return all;
}

}  // namespace moondb
