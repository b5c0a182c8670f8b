#include <map>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/health.h"
#include "model/leases.h"
#include "model/term.h"

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

std::vector<std::string> Row(const proto::AgentConfig& agent, const proto::AgentStatus& status) {
  return {agent.name(),
          std::to_string(agent.id()),
          RoleName(status.role()),
          TermText(status.roles().term()),
          FormatCount(RecordCountOf(status)),
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
  return count < 2 ? "" : leaders + " lead: they do not reach each other, or have not agreed yet\n";
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

ExitCode ShowStatus(CommandContext& context) {
  const auto answers = context.AskEach([](Client& client) { return client.Status(); });
  if (!answers) return context.Report(answers.error());
  Table table({"AGENT", "ID", "ROLE", "TERM", "RECORDS", "DATABASE", "PEERS", "UP", "PID", "MERGES BY"});
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
  json.EndArray().EndObject();
  const std::string leases = LeasesText((*context.Team())->config, statuses);
  const std::string leaders = LeadersText((*context.Team())->config, statuses);
  const ExitCode code = leaders.empty() ? ExitCodeOf(*answers) : ExitCode::kFailed;
  return context.Print(code, json.text(), table.Text() + leases + leaders + remarks);
}

}  // namespace

void AddStatusCommand(Command& app, CommandContext& context) {
  AddCommand(app, "status", "Show one row for each configured agent, reachable or not",
             {"moonctl status --watch=5", kShows})
      .Callback([&context] { context.action = [&context] { return ShowStatus(context); }; });
}

}  // namespace moondb
