// The commands config pack, config unpack and config add-agent.
#include <unistd.h>

#include <memory>

#include "apps/common/json_writer.h"
#include "apps/common/team_clients.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/robot_pack.h"
#include "apps/moonctl/written_files.h"
#include "model/file_writing.h"
#include "model/text.h"
#include "runtime/team/new_files.h"
#include "runtime/team/team_init.h"

namespace moondb {
namespace {

constexpr char kServiceFolder[] = "/var/lib/moondb";
constexpr char kUnit[] = "moondb-agent@.service";

struct PackArguments {
  std::string agent;
  std::string file;
  std::string folder = kServiceFolder;
  std::string options;
  std::string address;
  std::string client_address;
  std::string listen;
  std::string start;
  int id = 0;
};

// --- config add-agent ---

// Parses "x,y,yaw" or "x,y,z,yaw".
Result<proto::StartPose> ParseStart(const std::string& text) {
  std::vector<double> numbers;
  for (const std::string_view part : Split(text, ',')) {
    const auto number = ParseDouble(part);
    if (!number) break;
    numbers.push_back(*number);
  }
  const std::size_t count = Split(text, ',').size();
  if (numbers.size() != count || (count != 3 && count != 4)) {
    return Fail(ErrorCode::kInvalid, "expected x,y,yaw or x,y,z,yaw (m and rad), got \"" + OneLine(text) + "\"",
                "--start");
  }
  proto::StartPose start;
  start.set_x(numbers[0]);
  start.set_y(numbers[1]);
  if (count == 4) start.set_z(numbers[2]);
  start.set_yaw(numbers.back());
  start.set_sigma_m(0.05);
  start.set_sigma_rad(0.01);
  return start;
}

ExitCode AddToTeam(CommandContext& context, const PackArguments& arguments) {
  if (context.TeamPath().empty()) return context.Report(context.Team().error());
  const std::filesystem::path file = context.TeamPath();
  const auto yaml = ReadTextFile(file);
  if (!yaml) return context.Report(yaml.error());
  proto::AgentConfig agent;
  agent.set_id(static_cast<std::uint32_t>(arguments.id));
  agent.set_name(arguments.agent);
  agent.set_address(arguments.address);
  agent.set_client_address(arguments.client_address);
  agent.set_listen(arguments.listen);
  if (!arguments.start.empty()) {
    const auto start = ParseStart(arguments.start);
    if (!start) return context.Report(start.error());
    *agent.mutable_start() = *start;
  }
  NewFiles files;
  const auto longer = AddAgent(*yaml, file, agent, &files);
  if (!longer) return context.Report(longer.error());
  // Publish the keys first, so that the team file never names a key that is not there.
  if (const auto published = files.Publish(); !published) return context.Report(published.error());
  if (const auto replaced = ReplaceFile(file, *longer); !replaced) {
    files.TakeBack();
    return context.Report(replaced.error());
  }
  JsonWriter json;
  json.BeginObject().Key("file").String(file.string()).Key("agent").String(agent.name());
  json.Key("agent_id").Number(agent.id()).EndObject();
  return context.Done(
      json.text(),
      file.string() + ": added " + agent.name() + " (id " + std::to_string(agent.id()) +
          (agent.has_start() ? ")" : "), with an unknown start") + "\nnext: moonctl config pack " + agent.name() + " " +
          agent.name() +
          ".pack; also pack the other agents again, unpack each pack on its robot, and restart the agents");
}

// --- config pack ---

ExitCode Pack(CommandContext& context, const PackArguments& arguments) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  const auto named = MemberNamed((*team)->config, arguments.agent);
  if (!named) return context.Report(named.error());
  const auto pack = PackRobot(**team, context.TeamPath(), arguments.agent, arguments.options);
  if (!pack) return context.Report(pack.error());
  NewFiles files;
  if (const auto added = files.Add(arguments.file, SerializeRobotPack(*pack), 0600); !added) {
    return context.Report(added.error());
  }
  if (const auto published = files.Publish(); !published) return context.Report(published.error());
  JsonWriter json;
  json.BeginObject().Key("file").String(arguments.file).Key("agent").String(arguments.agent);
  json.Key("file_count").Number(pack->files_size()).EndObject();
  return context.Done(json.text(),
                      "wrote " + arguments.file + ": " + std::to_string(pack->files_size()) + " files of " +
                          arguments.agent +
                          ". The pack holds secret keys: copy it over a trusted link and delete it afterwards\n"
                          "next, on the robot: moonctl config unpack " +
                          std::filesystem::path(arguments.file).filename().string());
}

// --- config unpack ---

// Writes the unit of this installation for systemd, unless there is one. Returns its path; empty: none was written.
Result<std::string> WriteUnit(const std::filesystem::path& program_folder) {
  std::error_code failure;
  if (::geteuid() != 0 || !std::filesystem::exists("/run/systemd/system", failure)) return std::string();
  for (const char* folder : {"/etc/systemd/system", "/usr/lib/systemd/system", "/lib/systemd/system"}) {
    if (std::filesystem::exists(std::filesystem::path(folder) / kUnit, failure)) return std::string();
  }
  auto unit = ReadTextFile(program_folder.parent_path() / "lib/systemd/system" / kUnit);
  if (!unit) return std::string();
  const std::string start = "ExecStart=";
  const std::size_t at = unit->find(start) + start.size();
  unit->replace(at, unit->find(' ', at) - at, (program_folder / "moondb_agent").string());
  const std::string path = std::string("/etc/systemd/system/") + kUnit;
  if (const auto written = WriteWholeFile(path, *unit, {.mode = 0644, .is_synced = true}); !written)
    return tl::unexpected(written.error());
  return path;
}

ExitCode Unpack(CommandContext& context, const PackArguments& arguments) {
  const auto bytes = ReadTextFile(arguments.file, kRobotPackBytesMax);
  if (!bytes) return context.Report(bytes.error());
  const auto pack = ParseRobotPack(*bytes);
  if (!pack) return context.Report({pack.error().code, pack.error().text, arguments.file});
  const auto changed = UnpackRobot(*pack, arguments.folder);
  if (!changed) return context.Report(changed.error());
  const bool is_service = arguments.folder == kServiceFolder;
  const auto unit = is_service ? WriteUnit(context.program_folder()) : Result<std::string>();
  if (!unit) return context.Report(unit.error());
  JsonWriter json;
  json.BeginObject().Key("folder").String(arguments.folder).Key("agent").String(pack->agent());
  json.Key("changed").BeginArray();
  std::string names;
  for (const std::string& name : *changed) {
    json.String(name);
    names += (names.empty() ? "" : ", ") + name;
  }
  json.EndArray().Key("unit").String(*unit).EndObject();
  std::string text = names.empty()
                         ? arguments.folder + " already holds all files of " + pack->agent() + "; nothing to change"
                         : "wrote to " + arguments.folder + ": " + names;
  if (!unit->empty()) text += "\nwrote " + *unit;
  text += is_service
              ? "\nnext: systemctl enable --now moondb-agent@" + pack->agent() + " (if it runs: systemctl restart)"
              : "\nnext: moondb_agent -t " + (std::filesystem::path(arguments.folder) / kPackedTeamFile).string() +
                    " -a " + pack->agent();
  return context.Done(json.text(), text + "; delete " + arguments.file);
}

}  // namespace

void AddPackCommands(Command& group, CommandContext& context) {
  auto arguments = std::make_shared<PackArguments>();
  const auto add = [&](const char* name, const char* description, const CommandNote& note,
                       ExitCode (*run)(CommandContext&, const PackArguments&)) -> Command& {
    Command& command = AddCommand(group, name, description, note);
    command.Callback([&context, arguments, run] {
      context.action = [&context, arguments, run] { return run(context, *arguments); };
    });
    return command;
  };
  Command& added = add("add-agent", "Add a rover to the team file, and make its keys",
                       {"moonctl config add-agent rover4 --address tcp://10.0.0.14:7400"}, AddToTeam);
  added.AddOption("name", arguments->agent, "Name of the new agent").TypeName("NAME").Required();
  added.AddOption("--address", arguments->address, "Address at which other agents reach the new agent: tcp://HOST:PORT")
      .TypeName("ADDRESS")
      .Required();
  added.AddOption("--listen", arguments->listen, "Address on which the agent listens, if different: tcp://0.0.0.0:PORT")
      .TypeName("ADDRESS");
  added.AddOption("--client-address", arguments->client_address, "Address for clients with a key: tcp://HOST:PORT")
      .TypeName("ADDRESS");
  added.AddOption("--start", arguments->start, "Start pose x,y,yaw or x,y,z,yaw (m, rad; default: unknown)")
      .TypeName("POSE");
  added.AddOption("--id", arguments->id, "Id of the new agent (default: one more than the highest)").Within(1, 65535);

  Command& packed = add("pack", "Write all files of one agent into one file, with its secret keys",
                        {"moonctl config pack rover1 rover1.pack"}, Pack);
  packed.AddOption("agent", arguments->agent, "Name of the agent").TypeName("AGENT").Required();
  packed.AddOption("file", arguments->file, "Pack file to write").TypeName("FILE").Required();
  packed.AddOption("--options", arguments->options, "Options of moondb_agent, for the service").TypeName("OPTIONS");

  Command& unpacked =
      add("unpack", "Write the files of a pack on the robot", {"moonctl config unpack rover1.pack"}, Unpack);
  unpacked.AddOption("file", arguments->file, "File written by `moonctl config pack`").TypeName("FILE").Required();
  unpacked.AddOption("folder", arguments->folder, "Folder of the team file (/var/lib/moondb)").TypeName("FOLDER");
}

}  // namespace moondb
