
#include "apps/common/hash_text.h"
#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/config_schema.h"
#include "apps/moonctl/config_show.h"
#include "apps/moonctl/lab_team.h"
#include "apps/moonctl/radio_estimate.h"
#include "apps/moonctl/unplaced.h"
#include "apps/moonctl/written_files.h"
#include "model/command_from.h"
#include "model/mission.h"
#include "model/start_poses.h"
#include "model/team_id.h"
#include "model/text.h"
#include "runtime/team/team_init.h"

namespace moondb {
namespace {

struct ConfigArguments {
  std::string file;
  std::string name;
  std::string mission;
  int agent_count = 4;
  int first_port = 7400;
  bool is_fixing = false;
  bool is_lab = false;
  int robot_count = 2;
  std::vector<std::string> addresses;
  std::string base;
};

// Adds a team id to the file if it has none. Returns the new id, or an empty string if the file is unchanged. Ignores
// other faults of the file.
Result<std::string> AddTeamId(const std::filesystem::path& file) {
  const auto yaml = ReadTextFile(file);
  if (!yaml) return tl::unexpected(yaml.error());
  const std::set<std::string> given = GivenFields(*yaml);
  if (given.empty() || given.contains("team_id")) return std::string();
  const auto id = MakeTeamId();
  if (!id) return tl::unexpected(id.error());
  const auto fixed = WithTeamId(*yaml, *id);
  if (!fixed) return Fail(fixed.error().code, fixed.error().text, file.string());
  if (auto replaced = ReplaceFile(file, *fixed); !replaced) return tl::unexpected(replaced.error());
  return *id;
}

// Adds a team id to the team file if it has none. Every agent needs the same file with the same id.
ExitCode FixConfig(CommandContext& context) {
  if (context.TeamPath().empty()) return context.Report(context.Team().error());
  const auto id = AddTeamId(context.TeamPath());
  if (!id) return context.Report(id.error());
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  const std::string file = context.TeamPath().string();
  JsonWriter json;
  json.BeginObject().Key("file").String(file).Key("team").String((*team)->config.team());
  json.Key("team_id").String((*team)->config.team_id()).Key("is_changed").Bool(!id->empty()).EndObject();
  const std::string text =
      id->empty() ? "has a team id; nothing to fix"
                  : "now has the team id " + *id + "; copy the file to every agent of the team and restart the agents";
  return context.Done(json.text(), file + ": " + text);
}

ExitCode CheckConfig(CommandContext& context) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  const int count = (*team)->config.agents_size();
  JsonWriter json;
  json.BeginObject().Key("file").String(context.TeamPath().string()).Key("team").String((*team)->config.team());
  json.Key("agent_count").Number(count).Key("team_map_part_of_radio").Number(TeamMapPart((*team)->config));
  std::string text = context.TeamPath().string() + ": team " + (*team)->config.team() + " of " + std::to_string(count) +
                     " agents, no errors";
  const auto& commanders = (*team)->config.command_from();
  const bool all_command = std::find(commanders.begin(), commanders.end(), kAllMayCommand) != commanders.end();
  json.Key("all_may_command").Bool(all_command).Key("starts_that_do_not_count").BeginArray();
  std::string no_starts;
  for (const auto& [rover, other] : CoincidingStarts((*team)->config)) {
    json.String(AgentName((*team)->config, rover));
    text += "\nwarning: " + CoincidingText((*team)->config, rover, other);
  }
  json.EndArray().Key("without_start").BeginArray();
  for (const proto::AgentConfig& agent : (*team)->config.agents()) {
    if (agent.kind() == proto::AGENT_KIND_BASE_STATION || agent.has_start() || agent.left()) continue;
    json.String(agent.name());
    no_starts += (no_starts.empty() ? "" : ", ") + agent.name();
  }
  json.EndArray().EndObject();
  if (!no_starts.empty()) {
    text += "\nnote: no start pose for " + no_starts +
            ": the maps of such a rover stay out of the team's map until ranges, map matches or priors place the rover "
            "(docs/SENSORS.md)";
  }
  if (all_command) {
    text +=
        "\nnote: command_from: all lets every agent command all others and assign roles: an attacker who controls one "
        "robot controls the team";
  }
  const std::string radio = TeamMapText((*team)->config);
  if (!radio.empty()) text += "\n" + radio;
  return context.Done(json.text(), text);
}

ExitCode ShowConfig(CommandContext& context) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  const auto yaml = ReadTextFile(context.TeamPath());
  if (!yaml) return context.Report(yaml.error());
  const std::set<std::string> given = GivenFields(*yaml);
  const std::string hash = HashText((*team)->hash);
  JsonWriter json;
  json.BeginObject().Key("file").String(context.TeamPath().string()).Key("hash").String(hash);
  json.Key("config").Raw(ToJson((*team)->config)).Key("defaults").BeginArray();
  for (const std::string& field : DefaultedFields((*team)->config, given)) json.String(field);
  json.EndArray().EndObject();
  return context.Done(json.text(), "# " + context.TeamPath().string() + " with its defaults; hash " + hash + "\n" +
                                       EffectiveYaml((*team)->config, given));
}

// Prints the schema as the whole document, with or without --json.
ExitCode ShowSchema(CommandContext& context) {
  const std::string schema = TeamFileSchema();
  return context.Done(schema, schema);
}

proto::AgentConfig AgentOfMission(const MissionAgent& from, int port) {
  proto::AgentConfig agent;
  agent.set_id(from.id);
  agent.set_name(from.name);
  agent.set_address("tcp://127.0.0.1:" + std::to_string(port));
  for (int i = 0; i < 3; ++i) agent.add_antenna_m(from.antenna_m[i]);
  if (from.is_base_station) {
    agent.set_kind(proto::AGENT_KIND_BASE_STATION);
    for (int i = 0; i < 3; ++i) agent.add_position_m(from.start.position_m[i]);
    return agent;
  }
  proto::StartPose& start = *agent.mutable_start();
  start.set_x(from.start.position_m.x());
  start.set_y(from.start.position_m.y());
  start.set_z(from.start.position_m.z());
  start.set_yaw(from.start.Yaw());
  start.set_sigma_m(from.start_sigma_m);
  start.set_sigma_rad(from.start_sigma_rad);
  return agent;
}

Result<void> WriteTeamOfMission(const ConfigArguments& arguments) {
  auto mission = ReadMission(arguments.mission);
  if (!mission) return tl::unexpected(InputError(mission.error()));
  proto::TeamConfig team;
  const auto folder = std::filesystem::weakly_canonical(arguments.mission);
  team.set_team(arguments.name.empty() ? PlainNameOf(folder.filename().string()) : arguments.name);
  int port = arguments.first_port;
  for (const MissionAgent& agent : mission->agents) {
    *team.add_agents() = AgentOfMission(agent, port++);
    if (agent.is_base_station) continue;
    // By default the first two rovers are the initial leader and survivor.
    if (team.roles().leader().empty()) {
      team.mutable_roles()->set_leader(agent.name);
    } else if (team.roles().survivor().empty()) {
      team.mutable_roles()->set_survivor(agent.name);
    }
  }
  return WriteTeam(arguments.file, team);
}

ExitCode InitLab(CommandContext& context, const ConfigArguments& arguments) {
  const std::string name = arguments.name.empty() ? DefaultTeamName(arguments.file) : arguments.name;
  const auto team =
      MakeLabTeam({name, arguments.robot_count, arguments.addresses, arguments.base, arguments.first_port});
  if (!team) return context.Report(team.error());
  if (auto written = WriteTeam(arguments.file, *team); !written) return context.Report(written.error());
  JsonWriter json;
  json.BeginObject().Key("file").String(arguments.file).EndObject();
  std::string text =
      "wrote " + arguments.file + " and its keys. Records and the team's map are sent to all robots automatically";
  if (arguments.addresses.empty())
    text += "\nnote: all agents have addresses of this machine; give --address for agents on robots";
  if (team->agents_size() == 2) {
    text += "\nnote: failover is manual, because two agents that lose contact would otherwise both become leader";
  }
  return context.Done(json.text(), text);
}

ExitCode InitConfig(CommandContext& context, const ConfigArguments& arguments) {
  if (arguments.is_lab) return InitLab(context, arguments);
  const auto written = arguments.mission.empty() ? WriteInitialTeam(arguments.file, arguments.agent_count,
                                                                    arguments.first_port, arguments.name)
                                                 : WriteTeamOfMission(arguments);
  if (!written) return context.Report(written.error());
  JsonWriter json;
  json.BeginObject().Key("file").String(arguments.file).EndObject();
  std::string text = "wrote " + arguments.file + " and its keys";
  if (arguments.mission.empty())
    text += "\nnote: agents send records only on command; with --lab they send them automatically";
  return context.Done(json.text(), text);
}

}  // namespace

void AddConfigCommands(Command& app, CommandContext& context) {
  Command& group = app.AddSubcommand("config", "Create, check and distribute the team file");
  group.RequireSubcommand();
  auto arguments = std::make_shared<ConfigArguments>();
  // Adds a command that takes the team file as an argument: `config check FILE` equals `-t FILE config check`.
  const auto add_reader = [&](const char* name, const char* description, const CommandNote& note,
                              const std::function<ExitCode(CommandContext&)>& run) -> Command& {
    Command& command = AddCommand(group, name, description, note);
    command.AddOption("file", arguments->file, "Team file (default: -t or $MOONDB_TEAM)").TypeName("FILE");
    command.Callback([&context, arguments, run] {
      if (!arguments->file.empty()) context.team_path = arguments->file;
      context.action = [&context, run] { return run(context); };
    });
    return command;
  };
  add_reader(
      "check", "Check the team file and report all errors", {"moonctl config check team.yaml"},
      [arguments](CommandContext& asked) { return arguments->is_fixing ? FixConfig(asked) : CheckConfig(asked); })
      .AddFlag("--fix", arguments->is_fixing, "Add the missing team id; change nothing else");
  add_reader("show", "Show all settings; defaults are marked", {"moonctl config show team.yaml"}, ShowConfig);
  AddCommand(group, "schema", "Print the JSON Schema of team files, for editors",
             {"moonctl config schema > team.schema.json"})
      .Callback([&context] { context.action = [&context] { return ShowSchema(context); }; });

  Command& init = AddCommand(group, "init", "Create a team file and its keys",
                             {"moonctl config init --agents 4 my-team/team.yaml"});
  init.AddOption("file", arguments->file, "Path of the new team file").TypeName("FILE").Required();
  init.AddOption("--name", arguments->name, "Name of the team (default: name of the file's folder)").TypeName("NAME");
  init.AddOption("--agents", arguments->agent_count, "Number of agents; the last one is the base station")
      .Within(1, 64);
  Option& mission = init.AddOption("--mission", arguments->mission, "Use the agents of this recorded mission");
  mission.TypeName("FOLDER");
  init.AddOption("--first-port", arguments->first_port, "First loopback port (7400)").Within(1, 65000);
  Option& lab = init.AddFlag("--lab", arguments->is_lab,
                             "Set up robots on Wi-Fi: records and the team's map are sent to all robots automatically");
  lab.Excludes(mission);
  init.AddOption("--robots", arguments->robot_count, "Number of robots (2)").Within(1, 63).Needs(lab);
  init.AddOption("--address", arguments->addresses, "Address of an agent, such as rover1=10.0.0.11; may be repeated")
      .TypeName("NAME=HOST")
      .Needs(lab);
  init.AddOption("--base", arguments->base, "Add a base station with this name, which also receives the map")
      .TypeName("NAME")
      .Needs(lab);
  init.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return InitConfig(context, *arguments); }; });
  AddPackCommands(group, context);
}

}  // namespace moondb
