#include <signal.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <set>
#include <tuple>

#include "apps/common/data_folder.h"
#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/agent_process.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/ros_process.h"
#include "model/file_writing.h"
#include "model/term.h"
#include "model/text.h"
#include "proto/status.pb.h"
#include "runtime/team/team_keys.h"

namespace moondb {
namespace {

// Time limit for the start of all agents: a constant plus a part for each agent, because many agents on one small
// computer slow each other down.
constexpr std::chrono::seconds kStartTimeout(20);
constexpr std::chrono::seconds kStartTimeoutPerAgent(1);
constexpr std::chrono::seconds kStopTimeout(10);
constexpr std::chrono::seconds kAgreementTimeout(8);

struct UpArguments {
  std::string data_folder;    // Folder of the data folders. Empty: moondb-data in the team file's folder.
  std::string merge_backend;  // Empty: the default of moondb_agent.
  std::string log_format;     // Value of moondb_agent's --log-format.
  std::string with;           // "ros": also start moondb_ros beside each rover. Empty: agents alone.
};

// One agent of this machine, and the outcome of `up` or `down` for this agent.
struct LocalAgent {
  std::string name;
  std::filesystem::path folder;
  std::filesystem::path log;
  pid_t pid = 0;
  std::string state;
  std::string role = "-";
  bool is_ours = false;  // This command started the agent.
  std::string remark;    // A line printed below the table. Empty: no line.
  bool is_failed = false;
  bool has_left = false;  // The agent has left the team. It can be stopped, but is never started.
  bool is_rover = false;
  RosOutcome ros;
};

Result<proto::AgentStatus> RequestStatus(CommandContext& context, const LocalAgent& agent) {
  auto connected = context.ConnectHere(agent.name);
  if (!connected) return tl::unexpected(connected.error());
  return connected->client->Status();
}

// Returns the id of the process that answers requests for the agent. 0: no process answers.
pid_t AnsweringProcess(CommandContext& context, const LocalAgent& agent) {
  const auto status = RequestStatus(context, agent);
  return status ? static_cast<pid_t>(status->pid()) : 0;
}

// Returns the agent given with -a, otherwise all agents that run on this machine or have their secret keys on it.
Result<std::vector<LocalAgent>> LocalAgents(CommandContext& context, const UpArguments& arguments) {
  auto team = context.Team();
  if (!team) return tl::unexpected(team.error());
  if (!context.agent.empty()) {
    if (auto named = AgentNamed((*team)->config, context.agent); !named) return tl::unexpected(named.error());
  }
  std::vector<LocalAgent> agents;
  for (const proto::AgentConfig& agent : (*team)->config.agents()) {
    if (!context.agent.empty() && agent.name() != context.agent) continue;
    LocalAgent& local = agents.emplace_back();
    local.name = agent.name();
    local.has_left = agent.left();
    local.is_rover = agent.kind() == proto::AGENT_KIND_ROVER;
    const auto root = arguments.data_folder.empty() ? DefaultDataRoot((*team)->folder)
                                                    : std::filesystem::absolute(arguments.data_folder);
    const auto folder = FindDataFolder(root, (*team)->config, agent);
    if (!folder) {
      // The folder may belong to another team. Do not start or stop a process in it.
      local.is_failed = true;
      local.state = "failed: " + ToString(folder.error());
      continue;
    }
    local.folder = *folder;
    local.pid = OwnerOf(local.folder);
    const bool is_of_other_machine =
        context.agent.empty() && local.pid == 0 && !HasSecretKey((*team)->config, (*team)->folder, agent);
    if (is_of_other_machine) {
      agents.pop_back();
      continue;
    }
    if (folder->filename() != agent.name()) local.remark = agent.name() + " keeps its data in " + folder->string();
    const auto status = RequestStatus(context, local);
    if (status && status->name() != agent.name()) {
      local.remark += (local.remark.empty() ? "" : "\n") + agent.name() + " still runs under the name " +
                      OneLine(status->name()) + "; restart it to use the new name";
    }
    const pid_t answering = status ? static_cast<pid_t>(status->pid()) : 0;
    if (answering == 0 || answering == local.pid) continue;
    // Another process runs this agent. Do not start a second process, and do not stop the running one.
    local.is_failed = true;
    local.state = "process " + std::to_string(answering) + " runs this agent from another data folder";
  }
  if (agents.empty()) {
    return Fail(ErrorCode::kInvalid, "this machine has no secret key of an agent of team " + (*team)->config.team() +
                                         " (\"moonctl keys show\" lists the files)");
  }
  return agents;
}

// Returns agent.log in the data folder. If the file system is read-only, returns a new temporary file, or /dev/null if
// that file cannot be created.
std::filesystem::path LogFor(const LocalAgent& agent) {
  if (::access(agent.folder.c_str(), W_OK) == 0 || errno != EROFS) return agent.folder / "agent.log";
  std::string name = std::filesystem::temp_directory_path() / ("moondb-" + agent.name + "-XXXXXX");
  const int log = ::mkstemp(name.data());
  if (log >= 0) ::close(log);
  return log >= 0 ? name : "/dev/null";
}

// Returns true if all agents answer and hold the same role assignment, which is newer than the roles of the team file.
// Updates `role` of the agents.
bool IsAgreed(CommandContext& context, std::vector<LocalAgent>& agents) {
  std::set<std::tuple<std::uint64_t, std::uint32_t, std::uint64_t>> terms;
  for (LocalAgent& agent : agents) {
    const auto status = RequestStatus(context, agent);
    if (!status) return false;
    agent.role = RoleName(status->role());
    terms.insert(OrderOf(status->roles().term()));
  }
  return terms.size() == 1 && std::get<0>(*terms.begin()) > 0;
}

Result<void> Start(const CommandContext& context, const UpArguments& arguments, LocalAgent& agent) {
  if (const auto made = MakeDataFolder(agent.folder); !made) return made;
  // An agent refuses a folder that others may write. A folder of another user's cannot be changed, so it is not
  // reported.
  (void)SetFolderMode(agent.folder, S_IRWXU);
  std::vector<std::string> command{(context.program_folder() / "moondb_agent").string(),
                                   "--team",
                                   std::filesystem::absolute(context.TeamPath()).string(),
                                   "--agent",
                                   agent.name,
                                   "--data-dir",
                                   agent.folder.string()};
  if (!arguments.merge_backend.empty()) command.insert(command.end(), {"--merge-backend", arguments.merge_backend});
  if (!arguments.log_format.empty()) command.insert(command.end(), {"--log-format", arguments.log_format});
  agent.log = LogFor(agent);
  // The agent limits the size of its log file by renaming the file. A device must not be renamed.
  if (agent.log != "/dev/null") {
    command.insert(command.end(), {"--log-file", std::filesystem::absolute(agent.log).string()});
  }
  auto started = StartProcess(command, agent.log);
  if (!started) return tl::unexpected(started.error());
  agent.pid = *started;
  agent.is_ours = true;
  return {};
}

// Stops the agents that this command started, after one of them failed.
void StopOurs(std::vector<LocalAgent>& agents) {
  for (LocalAgent& agent : agents) {
    if (!agent.is_ours || agent.is_failed) continue;
    ::kill(agent.pid, SIGTERM);
    if (!WaitUntil(SteadyClock::now() + kStopTimeout, [&] { return HasEnded(agent.pid); })) ::kill(agent.pid, SIGKILL);
    agent.state = "stopped again";
  }
}

// Starts moondb_ros beside each rover. Several rovers of one machine are in one ROS graph, so their topics get a
// prefix.
void StartRosOf(const CommandContext& context, std::vector<LocalAgent>& agents) {
  const auto rover_count =
      std::count_if(agents.begin(), agents.end(), [](const auto& agent) { return agent.is_rover; });
  for (LocalAgent& agent : agents) {
    if (!agent.is_rover) continue;
    agent.ros = StartRos(
        {context.program_folder() / "moondb_ros", context.TeamPath(), agent.name, rover_count > 1 ? agent.name : ""},
        agent.folder);
  }
}

void Shutdown(CommandContext& context, LocalAgent& agent) {
  agent.ros = StopRos(agent.folder);
  const auto is_gone = [&] { return OwnerOf(agent.folder) == 0 && !context.ConnectHere(agent.name); };
  auto connected = context.ConnectHere(agent.name);
  if (agent.pid == 0 && !connected) {
    agent.state = "not running";
    return;
  }
  if (connected) (void)connected->client->Stop();
  agent.state = "stopped";
  if (connected && WaitUntil(SteadyClock::now() + kStopTimeout, is_gone)) return;
  const pid_t owner = OwnerOf(agent.folder);
  if (owner > 0) ::kill(owner, SIGTERM);
  if (WaitUntil(SteadyClock::now() + kStopTimeout, is_gone)) return;
  agent.state = "does not stop";
  agent.is_failed = true;
}

// Prints the agents in `agents`, then the agents in `left`, which have left the team. Returns kFailed if any of these
// agents failed, otherwise kDone.
ExitCode ShowOutcome(const CommandContext& context, const std::vector<LocalAgent>& agents,
                     const std::vector<LocalAgent>& left = {}) {
  Table table({"AGENT", "PID", "STATE", "ROLE", "DATA"});
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  ExitCode code = ExitCode::kDone;
  std::string remarks;
  std::vector<LocalAgent> all = agents;
  all.insert(all.end(), left.begin(), left.end());
  for (const LocalAgent& agent : all) {
    if (!agent.remark.empty()) remarks += agent.remark + "\n";
    if (!agent.ros.state.empty()) {
      const std::string process = agent.ros.pid == 0 ? "" : " (process " + std::to_string(agent.ros.pid) + ")";
      remarks += "moondb_ros of " + agent.name + process + ": " + OneLine(agent.ros.state) + "\n";
    }
    if (agent.is_failed || agent.ros.is_failed) code = ExitCode::kFailed;
    const std::string pid = agent.pid == 0 ? "-" : std::to_string(agent.pid);
    table.Add({agent.name, pid, agent.state, agent.role, agent.folder.string()});
    json.BeginObject().Key("name").String(agent.name).Key("pid").Number(agent.pid);
    json.Key("state").String(agent.state).Key("role").String(agent.role).Key("is_failed").Bool(agent.is_failed);
    json.Key("data_folder").String(agent.folder.string());
    if (!agent.ros.state.empty()) {
      json.Key("ros").BeginObject().Key("pid").Number(agent.ros.pid).Key("state").String(agent.ros.state);
      json.Key("is_failed").Bool(agent.ros.is_failed).EndObject();
    }
    json.EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(code, json.text(), table.Text() + remarks);
}

// Removes the agents that have left the team from `agents` and returns them. Such agents are not started.
std::vector<LocalAgent> TakeLeft(std::vector<LocalAgent>& agents) {
  const auto left =
      std::stable_partition(agents.begin(), agents.end(), [](const auto& agent) { return !agent.has_left; });
  std::vector<LocalAgent> taken(std::make_move_iterator(left), std::make_move_iterator(agents.end()));
  agents.erase(left, agents.end());
  for (LocalAgent& agent : taken)
    agent.state = agent.pid == 0 ? "has left the team" : "has left the team, but runs here";
  return taken;
}

Result<void> CheckHere(CommandContext& context) {
  context.StayHere();
  if (context.via.empty()) return {};
  return Fail(ErrorCode::kInvalid,
              "cannot be used: this command starts and stops processes of this machine; run it on the robot", "--via");
}

ExitCode Up(CommandContext& context, const UpArguments& arguments) {
  if (auto here = CheckHere(context); !here) return context.Report(here.error());
  auto agents = LocalAgents(context, arguments);
  if (!agents) return context.Report(agents.error());
  if (auto chosen = context.ChosenAgents(); !chosen) return context.Report(chosen.error());
  std::vector<LocalAgent> left = TakeLeft(*agents);
  const auto has_failed = [](const LocalAgent& agent) { return agent.is_failed; };
  if (std::any_of(agents->begin(), agents->end(), has_failed)) return ShowOutcome(context, *agents, left);
  const auto start = [&](LocalAgent& agent) {
    Result<void> started = Start(context, arguments, agent);
    if (!started) StopOurs(*agents);
    return started;
  };
  for (LocalAgent& agent : *agents) {
    if (agent.pid != 0) continue;
    if (auto started = start(agent); !started) return context.Report(started.error());
  }
  const auto deadline = SteadyClock::now() + kStartTimeout + agents->size() * kStartTimeoutPerAgent;
  for (LocalAgent& agent : *agents) {
    bool has_ended = false;
    Result<void> started;
    const bool is_decided = WaitUntil(deadline, [&] {
      // The process that owned the folder at first may have ended. If no process owns the folder now, start the agent.
      if (!agent.is_ours && OwnerOf(agent.folder) == 0) started = start(agent);
      has_ended = agent.is_ours && HasEnded(agent.pid);
      return !started || has_ended || AnsweringProcess(context, agent) == agent.pid;
    });
    if (!started) return context.Report(started.error());
    agent.state = agent.is_ours ? "started" : "was running";
    agent.is_failed = has_ended || !is_decided;
    if (has_ended) {
      agent.state = "failed: " + LastLine(agent.log);
    } else if (!is_decided) {
      agent.state = "does not answer; see " + agent.log.string();
      if (agent.is_ours) ::kill(agent.pid, SIGKILL);
    }
  }
  if (std::any_of(agents->begin(), agents->end(), has_failed)) {
    StopOurs(*agents);
  } else {
    // Wait until the agents agree on the roles, so that the next command finds a leader. Report no failure if they do
    // not agree, because the leader may run on another machine.
    WaitUntil(SteadyClock::now() + kAgreementTimeout, [&] { return IsAgreed(context, *agents); });
    if (arguments.with == "ros") StartRosOf(context, *agents);
  }
  return ShowOutcome(context, *agents, left);
}

ExitCode Down(CommandContext& context, const UpArguments& arguments) {
  if (auto here = CheckHere(context); !here) return context.Report(here.error());
  auto agents = LocalAgents(context, arguments);
  if (!agents) return context.Report(agents.error());
  for (LocalAgent& agent : *agents) {
    if (!agent.is_failed) Shutdown(context, agent);
  }
  return ShowOutcome(context, *agents);
}

}  // namespace

void AddUpCommands(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<UpArguments>();
  Command& up = AddCommand(app, "up", "Start the agents whose secret keys are on this machine (or -a)", {"moonctl up"});
  up.AddOption("--data-dir", arguments->data_folder, "Folder of the agents' data folders (moondb-data)")
      .TypeName("FOLDER");
  up.AddOption("--merge-backend", arguments->merge_backend, "Backend of map merging: auto, cpu or gl")
      .TypeName("{auto,cpu,gl}");
  up.AddOption("--log-format", arguments->log_format, "Format of agent.log: text, or json with one object per line")
      .TypeName("{text,json}")
      .OneOf({"text", "json"});
  up.AddOption("--with", arguments->with,
               "Also start this program for each rover: ros (moondb_ros, with ros.yaml beside the team file)")
      .TypeName("{ros}")
      .OneOf({"ros"});
  up.Callback([&context, arguments] { context.action = [&context, arguments] { return Up(context, *arguments); }; });
  Command& down =
      AddCommand(app, "down", "Stop the agents whose secret keys are on this machine (or -a)", {"moonctl down"});
  down.AddOption("--data-dir", arguments->data_folder, "Folder of the agents' data folders, as given to moonctl up")
      .TypeName("FOLDER");
  down.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return Down(context, *arguments); }; });
}

}  // namespace moondb
