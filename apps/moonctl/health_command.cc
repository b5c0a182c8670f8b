#include <algorithm>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/health.h"
#include "apps/moonctl/match_list.h"
#include "model/event.h"
#include "model/text.h"

namespace moondb {
namespace {

ExitCode ShowHealth(CommandContext& context) {
  const auto statuses = context.CallEach([](Client& client) { return client.Status(); });
  if (!statuses) return context.Report(statuses.error());
  const auto shares = context.CallEach([](Client& client) { return client.ShareStatus(); });
  if (!shares) return context.Report(shares.error());
  std::map<std::uint32_t, AgentReport> reports;
  for (const auto& [agent, status] : *statuses) {
    if (status) reports[agent->id()].status = *status;
  }
  for (const auto& [agent, share] : *shares) {
    if (share) reports[agent->id()].shares = *share;
  }
  for (const auto& [agent, status] : *statuses) {
    if (!status || status->role() != proto::ROLE_LEADER) continue;
    const auto leader = context.Connect(agent->name());
    if (!leader) continue;
    AgentReport& report = reports[agent->id()];
    if (const auto graph = leader->client->GraphStats()) report.last_solve = graph->last_solve();
    if (const auto map = leader->client->MapStats(/*with_cleared=*/true)) report.map_stats = *map;
    if (const auto matches = leader->client->Registration({})) report.registration = *matches;
  }
  for (auto& [agent, report] : reports) report.config_hash = context.ConfigHashOf(agent);
  const TeamFile& team = **context.Team();
  const auto findings = FindingsOn(team.config, reports, team.hash);

  Table table({"AGENT", "HEALTH", "WHAT"});
  JsonWriter json;
  json.BeginObject().Key("is_healthy").Bool(findings.empty() && reports.size() == statuses->size());
  json.Key("agents").BeginArray();
  for (const auto& asked : *statuses) {
    const auto& [agent, status] = asked;
    BeginAgent(asked, json);
    const auto found = findings.find(agent->id());
    json.Key("findings").BeginArray();
    if (!status) {
      table.Add({agent->name(), "unknown", WhyNoAnswer(status.error())}, Tone::kBad);
    } else if (found == findings.end()) {
      table.Add({agent->name(), "good"});
    }
    for (const std::string& what : found == findings.end() ? std::vector<std::string>{} : found->second) {
      table.Add({agent->name(), "BAD", what}, Tone::kBad);
      json.String(what);
    }
    json.EndArray().EndObject();
  }
  json.EndArray().EndObject();
  const ExitCode code = findings.empty() ? ExitCodeOf(*statuses) : ExitCode::kFailed;
  const bool has_news = std::any_of(statuses->begin(), statuses->end(), [](const auto& asked) {
    return asked.answer && !asked.answer->findings().empty();
  });
  const std::string hint =
      has_news ? "unacknowledged findings stay listed until `moonctl health acknowledge` (with -a: at one agent)\n"
               : "";
  std::string matching;
  for (const auto& [agent, report] : reports) {
    const std::string left = MatchingLeftText(report.registration.value_or(proto::RegistrationReply()));
    if (!left.empty()) matching = AgentName(team.config, agent) + ": " + left + " (moonctl graph matches)\n";
  }
  return context.Print(code, json.text(), table.Text() + matching + hint);
}

struct Acknowledged {
  std::vector<proto::HealthFinding> findings;
  double refused_commands = 0;  // Relayed commands refused since the agent's start or the last acknowledgment.
};

// Acknowledges the findings that the agent reports now. Later findings stay unacknowledged.
Result<Acknowledged> AcknowledgeAt(Client& client) {
  const Result<proto::AgentStatus> status = client.Status();
  if (!status) return tl::unexpected(status.error());
  Acknowledged acknowledged;
  std::int64_t until_ns = 0;
  for (const proto::HealthFinding& finding : status->findings()) {
    acknowledged.findings.push_back(finding);
    until_ns = std::max<std::int64_t>(until_ns, finding.timestamp_ns());
  }
  for (const proto::RefusedFrom& refused : status->refused()) {
    if (refused.cause() == proto::REFUSAL_CAUSE_COMMAND) acknowledged.refused_commands += refused.count();
  }
  if (acknowledged.findings.empty() && acknowledged.refused_commands == 0) return acknowledged;
  const Result<std::uint32_t> count = client.Acknowledge(until_ns);
  if (!count) return tl::unexpected(count.error());
  return acknowledged;
}

ExitCode AcknowledgeHealth(CommandContext& context) {
  const auto answers = context.CallEach(AcknowledgeAt);
  if (!answers) return context.Report(answers.error());
  Table table({"AGENT", "ACKNOWLEDGED"});
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (const auto& asked : *answers) {
    const auto& [agent, acknowledged] = asked;
    BeginAgent(asked, json);
    json.Key("acknowledged").BeginArray();
    if (!acknowledged) {
      table.Add({agent->name(), WhyNoAnswer(acknowledged.error())}, Tone::kBad);
    } else if (acknowledged->findings.empty() && acknowledged->refused_commands == 0) {
      table.Add({agent->name(), "-"});
    } else if (acknowledged->refused_commands > 0) {
      const std::string text = FormatCount(acknowledged->refused_commands) + " refused commands";
      table.Add({agent->name(), text});
      json.String(text);
    }
    const auto findings = acknowledged ? acknowledged->findings : std::vector<proto::HealthFinding>();
    for (const proto::HealthFinding& finding : findings) {
      const std::string text = FormatUtc(finding.timestamp_ns()) + ": " + OneLine(finding.text(), kEventTextBytesMax);
      table.Add({agent->name(), text});
      json.String(text);
    }
    json.EndArray().EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(ExitCodeOf(*answers), json.text(), table.Text());
}

}  // namespace

void AddHealthCommand(Command& app, CommandContext& context) {
  Command& health = AddCommand(app, "health", "Report problems; exit code 0 only if all agents are healthy",
                               {"moonctl health --json", kShows});
  health.AllowSubcommand();
  AddCommand(health, "acknowledge",
             "Acknowledge the findings of all agents (or -a): lost peers, damage, crashes, refused commands",
             {"moonctl health acknowledge -a rover2"})
      .Callback([&context] { context.action = [&context] { return AcknowledgeHealth(context); }; });
  health.Callback([&context, &health] {
    if (health.GivenSubcommand() != nullptr) return;
    context.action = [&context] { return ShowHealth(context); };
  });
}

}  // namespace moondb
