#include <CLI/CLI.hpp>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/health.h"

namespace moondb {
namespace {

ExitCode ShowHealth(CommandContext& context) {
  const auto statuses = context.AskEach([](Client& client) { return client.Status(); });
  if (!statuses) return context.Report(statuses.error());
  const auto shares = context.AskEach([](Client& client) { return client.ShareStatus(); });
  if (!shares) return context.Report(shares.error());
  std::map<std::uint32_t, AgentReport> reports;
  for (const auto& [agent, status] : *statuses) {
    if (status) reports[agent->id()].status = *status;
  }
  for (const auto& [agent, share] : *shares) {
    if (share) reports[agent->id()].shares = *share;
  }
  const auto findings = FindingsOn((*context.Team())->config, reports);

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
  return context.Print(code, json.text(), table.Text());
}

}  // namespace

void AddHealthCommand(CLI::App& app, CommandContext& context) {
  app.add_subcommand("health", "What is wrong, for people and scripts: ends with 0 only where all agents are well")
      ->callback([&context] { context.action = [&context] { return ShowHealth(context); }; });
}

}  // namespace moondb
