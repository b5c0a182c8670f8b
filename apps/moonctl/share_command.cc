#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/pause_command.h"
#include "apps/moonctl/share_status.h"
#include "apps/moonctl/share_wait.h"

namespace moondb {
namespace {

struct ShareArguments {
  std::vector<std::string> from;
  std::uint64_t bytes_max = 0;
  bool is_waiting = false;
};

const char* KindName(proto::SharingKind kind) {
  return kind == proto::SHARING_KIND_REPLICATION ? "replication" : "sync";
}

// Which sessions a request at `target` starts (proto/sharing.proto): at the leader, from those asked and then from
// itself to all; elsewhere from the agent to the leader.
std::vector<SharePair> PairsOf(const proto::TeamConfig& team, const proto::RoleAssignment& roles, AgentId target,
                               const proto::ShareRequest& request) {
  if (request.kind() == proto::SHARING_KIND_REPLICATION) return {{target, roles.survivor(), request.kind()}};
  if (target != roles.leader()) return {{target, roles.leader(), request.kind()}};
  std::vector<SharePair> pairs;
  const auto& from = request.from_agents();
  const auto is_meant = [&from](AgentId agent) {
    return from.empty() || std::find(from.begin(), from.end(), agent) != from.end();
  };
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.id() == target) continue;
    if (is_meant(agent.id())) pairs.push_back({agent.id(), target, request.kind()});
    if (is_meant(target)) pairs.push_back({target, agent.id(), request.kind()});
  }
  return pairs;
}

Result<proto::ShareRequest> MakeRequest(CommandContext& context, proto::SharingKind kind,
                                        const ShareArguments& arguments) {
  proto::ShareRequest request;
  request.set_kind(kind);
  request.set_bytes_max(arguments.bytes_max);
  auto team = context.Team();
  if (!team) return tl::unexpected(team.error());
  for (const std::string& name : arguments.from) {
    auto agent = AgentNamed((*team)->config, name);
    if (!agent) return tl::unexpected(agent.error());
    request.add_from_agents((*agent)->id());
  }
  return request;
}

std::string Joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

ExitCode ShareNow(CommandContext& context, proto::SharingKind kind, const ShareArguments& arguments) {
  auto request = MakeRequest(context, kind, arguments);
  if (!request) return context.Report(request.error());
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto roles = target->client->Roles();
  if (!roles) return context.Report(roles.error());

  std::optional<ShareWait> wait;
  if (arguments.is_waiting) {
    const proto::TeamConfig& team = (*context.Team())->config;
    wait.emplace(context, PairsOf(team, roles->roles(), target->agent->id(), *request));
  }
  auto reply = target->client->Share(*request);
  if (!reply) return context.Report(reply.error());
  if (wait) {
    if (auto done = wait->Wait(context.WaitTimeout()); !done) return context.Report(done.error());
  }

  JsonWriter json;
  json.BeginObject().Key("agent").String(target->agent->name()).Key("kind").String(KindName(kind));
  json.Key("session_count").Number(reply->session_count()).Key("is_acknowledged").Bool(wait && !wait->is_any_limited());
  json.Key("unreachable").BeginArray();
  for (const std::string& name : wait ? wait->unreachable() : std::vector<std::string>{}) json.String(name);
  json.EndArray().EndObject();
  std::string text = std::string(KindName(kind)) + " at " + target->agent->name();
  const char* acknowledged = wait && wait->is_any_limited() ? ": what the limit allows is acknowledged, more is left"
                                                            : ": everything is acknowledged";
  text += wait ? acknowledged
               : ": started, see moonctl " + std::string(kind == proto::SHARING_KIND_SYNC ? "sync" : "replicate") +
                     " status";
  if (wait && !wait->unreachable().empty()) text += "; unreachable: " + Joined(wait->unreachable());
  const bool is_partial = wait && !wait->unreachable().empty();
  return context.Print(is_partial ? ExitCode::kUnreachable : ExitCode::kDone, json.text(), text);
}

void WriteSession(const proto::TeamConfig& team, const proto::ShareSession& session, JsonWriter& json) {
  const SharePace pace = PaceOf(session);
  json.BeginObject().Key("to").String(AgentName(team, session.destination()));
  json.Key("bytes_per_s").Number(pace.bytes_per_s.value_or(NAN)).Key("eta_s").Number(pace.eta_s.value_or(NAN));
  json.Key("session").Raw(ToJson(session)).EndObject();
}

// The sessions of one agent of this kind, or that there is none yet.
void ShowSessions(const proto::TeamConfig& team, const std::string& agent, const proto::ShareStatus& status,
                  proto::SharingKind kind, Table& table, JsonWriter& json) {
  json.Key("sessions").BeginArray();
  bool is_any = false;
  for (const proto::ShareSession& session : status.sessions()) {
    if (session.kind() != kind) continue;
    is_any = true;
    table.Add(ShareStatusRow(team, agent, session));
    WriteSession(team, session, json);
  }
  if (!is_any) table.Add({agent, "-", "nothing sent since its start"});
  json.EndArray().Key("received_records").Number(status.received_records());
}

// What an agent refused of its peers, beyond the sessions; empty where all is well.
std::string RefusedText(const proto::TeamConfig& team, const proto::ShareStatus& status, proto::SharingKind kind) {
  std::string text;
  const auto add = [&text](double count, const char* what) {
    if (count > 0) text += (text.empty() ? "" : ", ") + FormatCount(count) + " " + what;
  };
  add(status.rejected_records(), "records rejected");
  add(status.damaged_messages(), "batches damaged");
  add(status.dropped_messages(), "batches dropped");
  add(status.refused_hellos(), "hellos refused");
  for (const AgentId agent : status.other_config_agents()) {
    text += (text.empty() ? "" : ", ") + AgentName(team, agent) + " has another team file";
  }
  for (const proto::ShareSession& session : status.sessions()) {
    if (session.kind() != kind) continue;
    for (const DataType type : session.other_schema_types()) {
      text += (text.empty() ? "" : ", ") + AgentName(team, session.destination()) + " gets no " +
              DataTypeName(type, team.custom_types()) + ": it understands something else by that type";
    }
  }
  return text;
}

// What each session has left to send, by type; empty where nothing is.
std::string BacklogText(const proto::TeamConfig& team, const std::string& agent, const proto::ShareStatus& status,
                        proto::SharingKind kind) {
  std::string text;
  for (const proto::ShareSession& session : status.sessions()) {
    if (session.kind() != kind || session.backlog().empty()) continue;
    std::vector<std::string> types;
    for (const proto::TypeBacklog& type : session.backlog()) {
      types.push_back(FormatCount(type.records()) + " " + DataTypeName(type.data_type(), team.custom_types()));
    }
    text += agent + " has left for " + AgentName(team, session.destination()) + ": " + Joined(types) + "\n";
  }
  return text;
}

void WriteRefused(const proto::TeamConfig& team, const proto::ShareStatus& status, JsonWriter& json) {
  json.Key("rejected_records").Number(status.rejected_records());
  json.Key("damaged_messages").Number(status.damaged_messages());
  json.Key("dropped_messages").Number(status.dropped_messages());
  json.Key("refused_hellos").Number(status.refused_hellos());
  json.Key("other_config_agents").BeginArray();
  for (const AgentId agent : status.other_config_agents()) json.String(AgentName(team, agent));
  json.EndArray();
}

ExitCode ShowShareStatus(CommandContext& context, proto::SharingKind kind) {
  const auto answers = context.AskEach([](Client& client) { return client.ShareStatus(); });
  if (!answers) return context.Report(answers.error());
  Table table(ShareStatusHeader());
  std::string backlog, refused;
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (const auto& asked : *answers) {
    const auto& [agent, status] = asked;
    BeginAgent(asked, json);
    if (status) {
      const proto::TeamConfig& team = (*context.Team())->config;
      ShowSessions(team, agent->name(), *status, kind, table, json);
      WriteRefused(team, *status, json);
      backlog += BacklogText(team, agent->name(), *status, kind);
      const std::string text = RefusedText(team, *status, kind);
      if (!text.empty()) refused += agent->name() + ": " + text + "\n";
    } else {
      table.Add({agent->name(), WhyNoAnswer(status.error())}, Tone::kBad);
    }
    json.EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(ExitCodeOf(*answers), json.text(), table.Text() + backlog + refused);
}

CLI::App& AddGroup(CLI::App& app, CommandContext& context, proto::SharingKind kind, const std::string& name,
                   const std::string& description) {
  CLI::App& group = *app.add_subcommand(name, description);
  group.require_subcommand(1);
  auto arguments = std::make_shared<ShareArguments>();
  CLI::App& now = *group.add_subcommand("now", "Start it, at the leader or at -a");
  now.add_flag("--wait", arguments->is_waiting, "Until everything is acknowledged");
  now.add_option("--max-bytes", arguments->bytes_max, "Each session ends when it has sent so many coded bytes")
      ->type_name("BYTES")
      ->check(CLI::PositiveNumber);
  if (kind == proto::SHARING_KIND_SYNC)
    now.add_option("--from", arguments->from, "Only from these agents")->type_name("AGENT");
  now.callback([&context, kind, arguments] {
    context.action = [&context, kind, arguments] { return ShareNow(context, kind, *arguments); };
  });
  CLI::App& status = *group.add_subcommand("status", "Per pair: sent, acknowledged, left, rate, ETA");
  status.callback([&context, kind, arguments] {
    context.action = [&context, kind, arguments] { return ShowShareStatus(context, kind); };
  });
  return group;
}

}  // namespace

void AddShareCommands(CLI::App& app, CommandContext& context) {
  AddPauseCommands(AddGroup(app, context, proto::SHARING_KIND_SYNC, "sync", "Bring records to the leader"), context);
  AddGroup(app, context, proto::SHARING_KIND_REPLICATION, "replicate", "Bring all records to the survivor");
}

}  // namespace moondb
