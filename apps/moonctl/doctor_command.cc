#include <map>
#include <memory>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/common/team_clients.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/diagnosis.h"
#include "apps/moonctl/health.h"
#include "apps/moonctl/robot_facts.h"
#include "proto/status.pb.h"
#include "runtime/team/team_keys.h"

namespace moondb {
namespace {

struct DoctorArguments {
  std::string data_folder;
};

// Adds what the team's agents report.
Result<void> AddReports(CommandContext& context, const TeamFile& team, const proto::AgentConfig& agent,
                        RobotFacts& facts) {
  context.agent.clear();
  const auto statuses = context.CallEach([](Client& client) { return client.Status(); });
  if (!statuses) return tl::unexpected(statuses.error());
  std::map<AgentId, PeerFacts*> peers;
  for (PeerFacts& peer : facts.peers) peers[peer.agent] = &peer;
  for (const auto& [asked, status] : *statuses) {
    const bool is_own = asked->id() == agent.id();
    if (is_own && !status) facts.agent_error = ToString(status.error());
    if (!status) continue;
    if (!is_own) {
      PeerFacts& peer = *peers.at(asked->id());
      peer.version = status->version();
      const std::uint64_t hash = context.ConfigHashOf(asked->id());
      if (hash != 0 && hash != team.hash) peer.other_team_file = OtherConfigText(hash, team.hash);
      continue;
    }
    facts.agent_version = status->version();
    for (const proto::PeerClockOffset& clock : status->storage().peer_clocks()) {
      if (const auto peer = peers.find(clock.agent_id()); peer != peers.end()) {
        peer->second->clock_offset_s = clock.offset_s();
      }
    }
  }
  return {};
}

const char* NameOf(RobotCheck::Kind kind) {
  switch (kind) {
    case RobotCheck::Kind::kGood:
      return "good";
    case RobotCheck::Kind::kAdvice:
      return "advice";
    case RobotCheck::Kind::kFault:
      return "FAULT";
    default:
      return "unknown";
  }
}

ExitCode Examine(CommandContext& context, const DoctorArguments& arguments) {
  const auto team = context.Team();
  if (!team) return context.Report(team.error());
  const auto agent = context.ChosenOrOnlyHere();
  if (!agent) return context.Report(agent.error());
  RobotFacts facts = GatherFacts(**team, **agent, arguments.data_folder);
  facts.version = MOONDB_VERSION;
  if (facts.is_running) {
    if (auto added = AddReports(context, **team, **agent, facts); !added) return context.Report(added.error());
  }
  const std::vector<RobotCheck> checks = Diagnose((*team)->config, **agent, facts);
  int fault_count = 0;
  Table table({"CHECK", "RESULT", "WHAT"});
  JsonWriter json;
  json.BeginObject().Key("agent").String((*agent)->name()).Key("checks").BeginArray();
  for (const RobotCheck& check : checks) {
    const bool is_fault = check.kind == RobotCheck::Kind::kFault;
    fault_count += is_fault ? 1 : 0;
    table.Add({check.what, NameOf(check.kind), check.text}, is_fault ? Tone::kBad : Tone::kPlain);
    if (!check.remedy.empty()) table.Add({"", "", "do: " + check.remedy});
    json.BeginObject().Key("check").String(check.what).Key("result").String(NameOf(check.kind));
    json.Key("text").String(check.text).Key("remedy").String(check.remedy).EndObject();
  }
  json.EndArray().Key("fault_count").Number(fault_count).EndObject();
  const std::string end = fault_count == 0 ? "no fault found on " + (*agent)->name()
                                           : std::to_string(fault_count) +
                                                 (fault_count == 1 ? " fault: correct it" : " faults: correct them") +
                                                 " before " + (*agent)->name() + " drives off";
  return context.Print(fault_count == 0 ? ExitCode::kDone : ExitCode::kFailed, json.text(), table.Text() + end);
}

}  // namespace

void AddDoctorCommand(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<DoctorArguments>();
  Command& doctor = AddCommand(app, "doctor", "Check this robot before it drives off; exit code 0 only without a fault",
                               {"moonctl doctor -a rover1", kShows});
  doctor.AddOption("--data-dir", arguments->data_folder, "Data folder of the agent, if it is not the default")
      .TypeName("FOLDER");
  doctor.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return Examine(context, *arguments); }; });
}

}  // namespace moondb
