#include <map>
#include <set>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/health.h"
#include "apps/moonctl/settled.h"
#include "model/leases.h"
#include "model/start_poses.h"
#include "model/team_member.h"
#include "model/term.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

double RecordCountOf(const proto::AgentStatus& status) {
  double count = 0;
  for (const proto::RecordCount& part : status.storage().counts()) count += part.count();
  return count;
}

std::string PeersText(const proto::AgentStatus& status) {
  int connected = 0;
  for (const proto::PeerStatus& peer : status.peers()) connected += peer.is_connected() ? 1 : 0;
  return std::to_string(connected) + "/" + std::to_string(status.peers_size());
}

// Returns how many records no other agent is known to have, and for how long: "45 for 25 min".
std::string OneCopyText(const proto::OneCopy& one_copy) {
  if (one_copy.count() == 0) return "0";
  return FormatCount(one_copy.count()) + " for " + FormatSeconds(one_copy.age_s());
}

std::vector<std::string> Row(const proto::AgentConfig& agent, const proto::AgentStatus& status) {
  return {agent.name(),
          std::to_string(agent.id()),
          RoleName(status.role()),
          TermText(status.roles().term()),
          FormatCount(RecordCountOf(status)),
          OneCopyText(status.storage().one_copy()),
          FormatBytes(status.storage().database_bytes()),
          PeersText(status),
          FormatSeconds(status.uptime_s()),
          std::to_string(status.pid()),
          status.merge_backend()};
}

// Returns one line per fault that an operator should know.
std::string RemarksOn(const proto::TeamConfig& team, const proto::AgentConfig& agent,
                      const proto::AgentStatus& status) {
  const proto::StorageStatus& storage = status.storage();
  std::string remarks;
  const auto remark = [&](const std::string& text) { remarks += agent.name() + ": " + text + "\n"; };
  if (!storage.clock_suspect().empty()) remark("clock suspect: " + storage.clock_suspect());
  if (status.has_unstored_roles()) remark(UnstoredText(team, status.unstored_roles()));
  if (!storage.write_trouble().empty()) {
    remark("stores nothing: " + storage.write_trouble());
  } else if (!storage.refused_inserts().empty()) {
    remark(storage.refused_inserts());
  } else if (!storage.space_low().empty()) {
    remark("space low: " + storage.space_low());
  }
  return remarks;
}

// Returns a warning if several agents lead, because the team is split or an agent does not know the newest assignment
// yet. Empty: at most one agent leads.
std::string LeadersText(const proto::TeamConfig& team, const std::vector<proto::AgentStatus>& statuses) {
  std::string leaders;
  int count = 0;
  for (const proto::AgentStatus& status : statuses) {
    if (status.role() != proto::ROLE_LEADER) continue;
    leaders += (count++ == 0 ? "" : " and ") + AgentName(team, status.agent_id()) + " (term " +
               TermText(status.roles().term()) + ")";
  }
  return count < 2 ? "" : leaders + " lead: they do not reach each other, or do not know the newest roles yet\n";
}

// Returns who leads by the newest assignment that an agent reports, if that agent does not answer. Otherwise empty.
std::string SilentLeaderText(const proto::TeamConfig& team, const std::vector<proto::AgentStatus>& statuses) {
  const proto::RoleAssignment* newest = nullptr;
  for (const proto::AgentStatus& status : statuses) {
    if (newest == nullptr || OrderOf(newest->term()) < OrderOf(status.roles().term())) newest = &status.roles();
  }
  if (newest == nullptr || newest->leader() == 0) return "";
  const bool has_answered = std::ranges::any_of(
      statuses, [&](const proto::AgentStatus& status) { return status.agent_id() == newest->leader(); });
  if (has_answered) return "";
  return AgentName(team, newest->leader()) + " leads (term " + TermText(newest->term()) + "), but does not answer\n";
}

// Lists the agents that drive, sleep or are paused, by their own reports. For an agent that does not answer, uses the
// reports of other agents.
std::string LeasesText(const proto::TeamConfig& team, const std::vector<proto::AgentStatus>& statuses) {
  std::map<AgentId, proto::AgentLease> known;
  for (const proto::AgentStatus& status : statuses) {
    for (const proto::AgentLease& lease : status.leases()) known[lease.agent_id()] = lease;
  }
  for (const proto::AgentStatus& status : statuses) {
    known.erase(status.agent_id());
    for (const proto::AgentLease& lease : status.leases()) {
      if (lease.agent_id() == status.agent_id()) known[lease.agent_id()] = lease;
    }
  }
  std::string text;
  for (const auto& [agent, lease] : known) text += AgentName(team, agent) + " " + ToString(lease) + "\n";
  return text;
}

// Returns one line for each rover that is not placed in the team's map, by the leader's last solve. Before the first
// solve, a rover without a start that counts is not placed.
std::string UnplacedLines(CommandContext& context, const proto::AgentStatus& leader) {
  const proto::TeamConfig& team = (*context.Team())->config;
  std::map<AgentId, double> nodes;
  std::map<AgentId, double> maps;
  for (const proto::RecordCount& count : leader.storage().counts()) {
    if (count.data_type() == proto::POSE_GRAPH_NODE) nodes[count.origin_agent()] += count.count();
    if (count.data_type() == proto::LOCAL_TRAVERSABILITY_MAP) maps[count.origin_agent()] += count.count();
  }
  const auto connected = context.Connect(leader.name());
  const auto graph = connected ? connected->client->GraphStats() : tl::unexpected(connected.error());
  std::map<AgentId, bool> is_unplaced;
  const std::set<AgentId> known_starts = KnownStarts(team);
  for (const auto& [agent, count] : nodes) {
    const auto* config = FindAgent(team, agent);
    if (config != nullptr && config->kind() == proto::AGENT_KIND_ROVER)
      is_unplaced[agent] = !known_starts.contains(agent);
  }
  if (graph) {
    for (const proto::RoverSolution& rover : graph->last_solve().rovers())
      is_unplaced[rover.agent_id()] = rover.is_unplaced();
  }
  std::string text;
  for (const auto& [agent, is_so] : is_unplaced) {
    if (!is_so) continue;
    text += AgentName(team, agent) + ": not placed in the team's map, " +
            FormatCount(maps[agent], "map waits", "maps wait") + ", see moonctl map stats\n";
  }
  return text;
}

// Asks all agents whether the team is quiescent. Requires: records flow by themselves.
Result<std::string> FindWhyNotSettled(CommandContext& context, const proto::AgentStatus& leader) {
  const proto::TeamConfig& team = (*context.Team())->config;
  TeamActivity activity;
  const auto sharing = context.CallEach([](Client& client) { return client.ShareStatus(); });
  if (!sharing) return tl::unexpected(sharing.error());
  for (const auto& [agent, status] : *sharing) {
    if (status) {
      activity.sharing.emplace_back(agent->id(), *status);
    } else {
      activity.away.insert(agent->id());
    }
  }
  // Asked after the transfers: records that arrive meanwhile make a solve due.
  const auto connected = context.Connect(AgentName(team, leader.agent_id()));
  if (!connected) return tl::unexpected(connected.error());
  auto graph = connected->client->GraphStats();
  if (!graph) return tl::unexpected(graph.error());
  auto registration = connected->client->Registration();
  if (!registration) return tl::unexpected(registration.error());
  activity.graph = *std::move(graph);
  activity.registration = *std::move(registration);
  return WhyNotSettled(team, activity);
}

ExitCode ShowStatus(CommandContext& context) {
  const auto answers = context.CallEach([](Client& client) { return client.Status(); });
  if (!answers) return context.Report(answers.error());
  Table table({"AGENT", "ID", "ROLE", "TERM", "RECORDS", "ONE COPY", "DATABASE", "PEERS", "UP", "PID", "MERGES BY"});
  JsonWriter json;
  json.BeginObject().Key("team").String((*context.Team())->config.team()).Key("agents").BeginArray();
  std::string remarks;
  std::vector<proto::AgentStatus> statuses;
  for (const auto& asked : *answers) {
    const auto& [agent, status] = asked;
    BeginAgent(asked, json);
    json.Key("id").Number(agent->id());
    if (status) {
      table.Add(Row(*agent, *status));
      remarks += RemarksOn((*context.Team())->config, *agent, *status);
      json.Key("status").Raw(ToJson(*status));
      statuses.push_back(*status);
    } else {
      table.Add({agent->name(), std::to_string(agent->id()), WhyNoAnswer(status.error())}, Tone::kBad);
    }
    json.EndObject();
  }
  json.EndArray();
  // List the agents that have left, because their ids and names stay reserved. They get no requests.
  json.Key("left").BeginArray();
  for (const proto::AgentConfig& agent : (*context.Team())->config.agents()) {
    if (!agent.left() || !context.agent.empty()) continue;
    table.Add({agent.name(), std::to_string(agent.id()), "has left the team"});
    json.String(agent.name());
  }
  json.EndArray();
  std::string settled;
  if ((*context.Team())->config.radio().sync_period_s() > 0 && context.agent.empty()) {
    std::string why = "the leader does not answer";
    for (const proto::AgentStatus& status : statuses) {
      if (status.role() != proto::ROLE_LEADER) continue;
      const auto asked = FindWhyNotSettled(context, status);
      why = asked ? *asked : ToString(asked.error());
    }
    settled = (why.empty() ? "settled: each agent has the records that it should have" : "not settled: " + why) + "\n";
    json.Key("is_settled").Bool(why.empty());
    if (!why.empty()) json.Key("not_settled").String(why);
  }
  json.EndObject();
  const std::string leases = LeasesText((*context.Team())->config, statuses);
  const std::string leaders = LeadersText((*context.Team())->config, statuses);
  const std::string silent =
      context.agent.empty() ? SilentLeaderText((*context.Team())->config, statuses) : std::string();
  for (const proto::AgentStatus& status : statuses) {
    if (status.role() == proto::ROLE_LEADER) remarks += UnplacedLines(context, status);
  }
  const ExitCode code = leaders.empty() ? ExitCodeOf(*answers) : ExitCode::kFailed;
  return context.Print(code, json.text(), table.Text() + silent + leases + leaders + remarks + settled);
}

}  // namespace

void AddStatusCommand(Command& app, CommandContext& context) {
  AddCommand(app, "status", "Show one row for each configured agent, reachable or not",
             {"moonctl status --watch=5", kShows})
      .Callback([&context] { context.action = [&context] { return ShowStatus(context); }; });
}

}  // namespace moondb
