// moondb_ros: joins a robot's ROS 2 graph to its moondb agent, without ROS (docs/ROS.md).
//
// Exit codes: 0 ended by SIGINT or SIGTERM, 1 failed, 2 the command line or a file is wrong, 3 the agent or the network
// is not there. `moondb_ros check` ends with 1 if odometry or maps do not work.

#include <signal.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include "apps/common/arguments.h"
#include "apps/common/data_folder.h"
#include "apps/common/team_clients.h"
#include "apps/moondb_ros/ros_bridge.h"
#include "apps/moondb_ros/ros_settings.h"
#include "apps/moondb_ros/topic_check.h"
#include "model/start_poses.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr std::chrono::seconds kCheck{10};
constexpr std::size_t kConfigBytesMax = 256 * 1024;

volatile sig_atomic_t is_ended = 0;

void Print(const std::string& line) {
  std::fprintf(stderr, "moondb_ros: %s\n", OneLine(line).c_str());
  std::fflush(stderr);
}

// Reads the newest own node, and waits until the agent is there and has it. An agent that lost its store, but not the
// file of `state`, gets its nodes back from the team; their indices must not be used again. nullopt if the program was
// ended.
std::optional<Result<std::optional<RobotMapper::Stored>>> WaitForStored(const AgentLink::Connect& connect,
                                                                        AgentId agent, const proto::RosState& state,
                                                                        const std::filesystem::path& state_file) {
  for (std::string said; is_ended == 0;) {
    const Result<std::unique_ptr<Client>> client = connect();
    auto stored = client ? ReadNewestNode(**client, agent) : tl::unexpected(client.error());
    std::string waits_for;
    if (!stored && stored.error().code != ErrorCode::kUnavailable && stored.error().code != ErrorCode::kTimedOut) {
      return stored;
    }
    if (!stored) waits_for = stored.error().text + "; waiting for the agent";
    const bool is_lost = stored && state.has_odom_from_node() && (!*stored || (*stored)->index < state.node_index());
    if (is_lost) {
      waits_for = "the agent's store lacks node " + std::to_string(state.node_index()) +
                  " of this robot; waiting until other agents return it. If none has it, delete " + state_file.string();
    }
    if (stored && !is_lost) return stored;
    if (std::exchange(said, waits_for) != waits_for) Print(waits_for);
    const timespec second{1, 0};
    nanosleep(&second, nullptr);
  }
  return std::nullopt;
}

Result<void> Bridge(const RosSettings& settings) {
  const Result<TeamFile> team = ReadTeamFile(settings.team);
  if (!team) return tl::unexpected(team.error());
  const Result<const proto::AgentConfig*> agent = MemberNamed(team->config, settings.agent);
  if (!agent) return tl::unexpected(agent.error());
  const auto folder = settings.data_folder.empty()
                          ? FindDataFolder(DefaultDataRoot(team->folder), team->config, **agent)
                          : Result<std::filesystem::path>(settings.data_folder);
  if (!folder) return tl::unexpected(folder.error());
  const std::filesystem::path own_folder = *folder / "ros";
  const Result<DataFolderLock> lock = DataFolderLock::Take(own_folder);
  if (!lock) {
    return Fail(lock.error().code, "another moondb_ros runs for " + settings.agent + " (" + lock.error().text + ")");
  }

  RosBridge::Options options;
  options.settings = settings;
  options.agent = (*agent)->id();
  options.is_start_known = KnownStarts(team->config).contains((*agent)->id());
  if (options.is_start_known) options.first = PoseOf((*agent)->start());
  options.boot_id = ReadTextFile("/proc/sys/kernel/random/boot_id").value_or("");
  options.state_file = own_folder / "moondb_ros.state";
  options.connect = [&] { return ConnectTo(*team, **agent, {}); };
  options.print = Print;
  for (std::string said; is_ended == 0;) {
    const proto::RosState state = ReadRosState(options.state_file);
    auto stored = WaitForStored(options.connect, options.agent, state, options.state_file);
    if (!stored) return {};
    if (!*stored) return tl::unexpected(stored->error());
    options.stored = **stored;
    if (options.stored) options.stored->state = state;
    const auto bridge = RosBridge::Start(options);
    if (!bridge) return tl::unexpected(bridge.error());
    if (said.empty()) {
      Print("agent " + settings.agent + ", domain " + std::to_string(settings.domain_id) + ": publishes " +
            settings.MapTopic() + "; waits for " + settings.TopicName(settings.odometry_topic));
    }
    Result<void> stepped;
    while (is_ended == 0 && stepped) stepped = (*bridge)->Step();
    if (stepped) return {};
    const std::string text =
        "a node was refused: " + ToString(stepped.error()) + "; continuing from the newest stored one";
    if (std::exchange(said, text) != text) Print(text);
  }
  return {};
}

int Finish(const Result<void>& result) {
  if (result) return 0;
  Print(ToString(result.error()));
  if (result.error().code == ErrorCode::kInvalid || result.error().code == ErrorCode::kNotFound) return 2;
  return result.error().code == ErrorCode::kUnavailable ? 3 : 1;
}

// Reads the file of --config before the command line is parsed, so that options take precedence.
Result<RosSettings> ReadSettings(int argc, char** argv) {
  std::string file;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--config" && i + 1 < argc) file = argv[i + 1];
    if (word.starts_with("--config=")) file = word.substr(9);
  }
  if (file.empty()) return ParseRosSettings("{}", "");
  const Result<std::string> text = ReadTextFile(file, kConfigBytesMax);
  return text ? ParseRosSettings(*text, file) : tl::unexpected(text.error());
}

int Run(int argc, char** argv) {
  Result<RosSettings> read = ReadSettings(argc, argv);
  if (!read) return Finish(tl::unexpected(read.error()));
  RosSettings& settings = *read;
  std::string config;
  bool is_lidar = settings.odometry_kind == proto::ODOMETRY_KIND_LIDAR;
  Command app("moondb_ros", "Joins a robot's ROS 2 graph to its moondb agent.");
  app.Fallthrough().AllowSubcommand();
  Command& check = app.AddSubcommand("check", "Listen for 10 s, and print how each topic is used (needs no agent)");
  app.AddOption("--config", config, "YAML file with the names of these options");
  app.AddOption("-t,--team", settings.team, "Team file").EnvName("MOONDB_TEAM");
  app.AddOption("-a,--agent", settings.agent, "This robot's agent");
  app.AddOption("--data-dir", settings.data_folder, "The agent's data folder (moondb-data/AGENT beside the team file)");
  app.AddOption("--odom", settings.odometry_topic, "Topic of nav_msgs/Odometry").DefaultShown();
  app.AddOption("--scan", settings.scan_topic, "Topic of sensor_msgs/LaserScan, for the local maps").DefaultShown();
  app.AddOption("--grid", settings.grid_topics, "Topics of nav_msgs/OccupancyGrid, in place of the scan");
  app.AddOption("--namespace", settings.name_space, "Prefix of all topics, such as robot1");
  app.AddOption("--node-distance-m", settings.rule.distance_m, "Distance after which a new node is inserted")
      .Within(0.1, 100.0)
      .DefaultShown();
  app.AddOption("--node-turn-deg", settings.rule.turn_deg, "Turn after which a new node is inserted")
      .Within(1.0, 180.0)
      .DefaultShown();
  app.AddOption("--node-age-s", settings.rule.age_s, "Time after which a new node is inserted")
      .Within(1.0, 86400.0)
      .DefaultShown();
  app.AddFlag("--lidar-odometry", is_lidar,
              "Odometry comes from a lidar or cameras: its error is 1 % of the distance, not 5 %");
  app.AddFlag("--publish-as-map", settings.is_published_as_map, "Publish /map, for robots without localization");
  app.AddFlag("--sim-time", settings.is_simulated_time, "Timestamps are simulated time, from 0");
  app.AddOption("--domain-id", settings.domain_id, "DDS domain")
      .EnvName("ROS_DOMAIN_ID")
      .Within(0u, 232u)
      .DefaultShown();
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code == 0 ? 0 : 2;
  settings.odometry_kind = is_lidar ? proto::ODOMETRY_KIND_LIDAR : proto::ODOMETRY_KIND_WHEEL;
  if (check.is_given()) {
    std::printf("listening for %lld s\n", static_cast<long long>(kCheck.count()));
    std::fflush(stdout);
    const Result<bool> works = CheckTopics(settings, kCheck);
    return works ? (*works ? 0 : 1) : Finish(tl::unexpected(works.error()));
  }
  if (settings.agent.empty() || settings.team.empty()) {
    return Finish(Fail(ErrorCode::kInvalid,
                       "name the team file and this robot's agent: --team team/team.yaml "
                       "--agent rover1"));
  }
  struct sigaction action {};
  action.sa_handler = [](int) { is_ended = 1; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return Finish(Bridge(settings));
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) { return moondb::Run(argc, argv); }
