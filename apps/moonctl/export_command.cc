#include <algorithm>
#include <filesystem>

#include "apps/common/json_writer.h"
#include "apps/common/utc.h"
#include "apps/mcap/mcap_writer.h"
#include "apps/mcap/ros_messages.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/file_origin.h"
#include "apps/moonctl/team_recording.h"
#include "apps/moonctl/time_span_option.h"
#include "apps/moonctl/written_files.h"
#include "model/file_writing.h"
#include "model/team_member.h"

namespace moondb {
namespace {

constexpr char kMapFrame[] = "team_map";
constexpr char kCdr[] = "cdr";

// The quality of service of a topic whose last message late subscribers get, as rosbag2 writes it for ROS 2 Humble.
constexpr char kLatched[] =
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n"
    "  deadline:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n"
    "  avoid_ros_namespace_conventions: false";

struct McapArguments {
  std::string folder;
  std::string from;
  std::string to;
};

// The topics of a recording, in the order of their channels.
class Topics {
 public:
  explicit Topics(McapWriter& writer) : writer_(writer) {}

  std::uint16_t Add(const std::string& topic, const RosType& type, const std::string& qos = "") {
    const auto known = schemas_.find(type.name);
    const std::uint16_t schema = known != schemas_.end()
                                     ? known->second
                                     : (schemas_[type.name] = writer_.AddSchema(type.name, "ros2msg", type.definition));
    topics_.push_back({topic, type.name, qos});
    return writer_.AddChannel(schema, topic, kCdr, {{"offered_qos_profiles", qos}});
  }
  std::string Yaml(const std::string& file) const;

 private:
  struct Topic {
    std::string name;
    std::string type;
    std::string qos;
  };

  McapWriter& writer_;
  std::map<std::string, std::uint16_t> schemas_;
  std::vector<Topic> topics_;
};

// Returns metadata.yaml of rosbag2, version 5, which ROS 2 Humble and later read.
std::string Topics::Yaml(const std::string& file) const {
  const McapWriter::Counts& counts = writer_.counts();
  const std::string start = std::to_string(counts.first_ns);
  const std::string duration = std::to_string(counts.last_ns - counts.first_ns);
  const std::string messages = std::to_string(counts.messages);
  std::string yaml =
      "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: " +
      duration + "\n  starting_time:\n    nanoseconds_since_epoch: " + start + "\n  message_count: " + messages +
      "\n  topics_with_message_count:\n";
  for (std::size_t i = 0; i < topics_.size(); ++i) {
    std::string qos = topics_[i].qos;
    for (std::size_t at = 0; (at = qos.find('\n', at)) != std::string::npos; at += 2) qos.replace(at, 1, "\\n");
    yaml += "    - topic_metadata:\n        name: " + topics_[i].name + "\n        type: " + topics_[i].type +
            "\n        serialization_format: cdr\n        offered_qos_profiles: \"" + qos +
            "\"\n      message_count: " + std::to_string(counts.by_channel.at(static_cast<std::uint16_t>(i))) + "\n";
  }
  return yaml + "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " + file +
         "\n  files:\n    - path: " + file + "\n      starting_time:\n        nanoseconds_since_epoch: " + start +
         "\n      duration:\n        nanoseconds: " + duration + "\n      message_count: " + messages + "\n";
}

// The channels of one agent.
struct AgentTopics {
  std::string name;
  std::uint16_t pose = 0;
};

Result<void> WriteRecording(const proto::TeamConfig& team, const TeamRecording& recording, McapWriter& writer,
                            Topics& topics) {
  const std::uint16_t map = topics.Add("/team_map", kOccupancyGridType, kLatched);
  const std::uint16_t tf = topics.Add("/tf", kTfMessageType);
  const std::uint16_t events = topics.Add("/team/events", kLogType);
  std::map<AgentId, AgentTopics> agents;
  std::set<std::string> names;
  for (const proto::AgentConfig& agent : team.agents()) {
    std::string name = RosName(agent.name());
    if (!names.insert(name).second) name += "_" + std::to_string(agent.id());
    agents[agent.id()] = {name, topics.Add("/team/" + name + "/pose", kPoseStampedType)};
  }
  const auto at = [](std::int64_t ns) { return static_cast<std::uint64_t>(ns); };
  TeamRecording::Sink sink;
  sink.pose = [&](const PoseView& pose) -> Result<void> {
    const auto agent = agents.find(pose.node.agent);
    if (agent == agents.end()) return {};
    const std::string moved =
        TfMessage(kMapFrame, agent->second.name + "/base_link", pose.timestamp_ns, pose.map_from_body);
    if (auto done = writer.Write(tf, at(pose.timestamp_ns), moved); !done) return done;
    return writer.Write(agent->second.pose, at(pose.timestamp_ns),
                        PoseStampedMessage(kMapFrame, pose.timestamp_ns, pose.map_from_body));
  };
  sink.event = [&](const EventView& event) {
    return writer.Write(events, at(event.timestamp_ns), LogMessage(AgentName(team, event.agent), event));
  };
  sink.map = [&](const MapView& view) {
    return writer.Write(map, at(view.timestamp_ns), OccupancyGridMessage(kMapFrame, view));
  };
  return recording.Replay(sink);
}

// Returns one line for each kind of records that the recording leaves out.
std::string LeftOutText(const proto::TeamConfig& team, const TeamRecording& recording) {
  std::string text;
  for (const auto& [agent, maps] : recording.unplaced()) {
    text += AgentName(team, agent) + " is not placed in the team's map: its poses and " + std::to_string(maps) +
            " maps are excluded; moonctl health gives the remedy\n";
  }
  if (recording.without_time_count() > 0) {
    text += "excluded " + std::to_string(recording.without_time_count()) +
            " poses and events with timestamps from a wrong clock or outside the years 1970 to 2038\n";
  }
  return text;
}

ExitCode ExportMcap(CommandContext& context, const McapArguments& arguments) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  const proto::TeamConfig& config = (*team)->config;
  const Result<TimestampRange> times =
      ParseTimestampRange({arguments.from, "--from"}, {arguments.to, "--to"}, UtcNowNs(), {.from_ns = 0});
  if (!times) return context.Report(times.error());
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  const Result<TeamRecording> recording = TeamRecording::Read(*target->client, config, *times);
  if (!recording) return context.Report(recording.error());

  const std::filesystem::path folder(arguments.folder);
  if (const std::error_code error = MakeFolders(folder)) {
    return context.Report({ErrorCode::kInternal, "cannot make the folder: " + error.message(), folder.string()});
  }
  const std::string name = std::filesystem::absolute(folder / "").parent_path().filename().string() + "_0.mcap";
  Result<McapWriter> writer = McapWriter::Open(folder / name, "ros2");
  if (!writer) return context.Report(writer.error());
  Topics topics(*writer);
  const FileNotes notes =
      NotesOf(OriginOf(config, *target),
              {{"maps", std::to_string(recording->map_count())},
               {"poses",
                "the newest; the merged map of each time contains the maps measured until then, at the newest poses"}});
  McapWriter::Metadata metadata(notes.begin(), notes.end());
  Result<void> written = WriteRecording(config, *recording, *writer, topics);
  if (written) written = writer->Close("moondb", metadata);
  if (written) written = WriteTogether(folder, {{folder / "metadata.yaml", topics.Yaml(name)}});
  if (!written) {
    return context.Report({written.error().code,
                           written.error().text + "; the file is readable up to its last complete chunk",
                           written.error().field});
  }
  const std::string file = (folder / name).string();
  const std::string messages = std::to_string(writer->counts().messages);
  JsonWriter json;
  json.BeginObject().Key("file").String(file).Key("messages").Number(static_cast<double>(writer->counts().messages));
  json.Key("notes").WriteNotes(notes).EndObject();
  return context.Done(json.text(), "wrote " + file + " and metadata.yaml: " + messages + " messages\n" +
                                       NotesText(notes) + LeftOutText(config, *recording));
}

}  // namespace

void AddExportCommands(Command& app, CommandContext& context) {
  Command& group = app.AddSubcommand("export", "Export an agent's data to file formats of other programs");
  group.RequireSubcommand();
  auto arguments = std::make_shared<McapArguments>();
  Command& mcap = AddCommand(group, "mcap", "Write map, poses and events of the leader (or -a) for Foxglove and ROS 2",
                             {"moonctl export mcap recording --from 2h"});
  mcap.AddOption("folder", arguments->folder, "Output folder; created if missing").TypeName("FOLDER").Required();
  mcap.AddOption("--from", arguments->from, "Start time: an age (2h) or a UTC time (2026-11-22T06:00Z)")
      .TypeName("TIME");
  mcap.AddOption("--to", arguments->to, "End time: an age or a UTC time").TypeName("TIME");
  mcap.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return ExportMcap(context, *arguments); }; });
}

}  // namespace moondb
