#include <algorithm>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/file_origin.h"
#include "apps/moonctl/map_files.h"
#include "apps/moonctl/map_questions.h"
#include "apps/moonctl/unplaced.h"
#include "model/text.h"

namespace moondb {
namespace {

struct MapArguments {
  std::string folder;
  std::string format = "nav2";
  bool use_raw_poses = false;
  std::vector<std::string> agents;
};

Result<proto::MergeRequest> MakeRequest(const proto::TeamConfig& team, const MapArguments& arguments) {
  proto::MergeRequest request;
  request.set_use_raw_poses(arguments.use_raw_poses);
  for (const std::string& name : arguments.agents) {
    auto agent = AgentNamed(team, name);
    if (!agent) return tl::unexpected(agent.error());
    request.add_agents((*agent)->id());
  }
  if (arguments.format != "geotiff" || team.has_site()) return request;
  return Fail(ErrorCode::kInvalid,
              "the team file gives no geographic position of the map; GeoTIFF needs site: {lat_deg: .., lon_deg: .., "
              "north_yaw_rad: ..}",
              "site");
}

FileNotes NotesOn(const proto::TeamConfig& team, const MapArguments& arguments, const proto::MergeReply& reply) {
  std::string names;
  for (const AgentId agent : reply.maps_of()) names += (names.empty() ? "" : ", ") + AgentName(team, agent);
  FileNotes notes{
      {"maps_of", names},
      {"maps", FormatCount(reply.map_count())},
      {"waiting_maps", FormatCount(reply.waiting_map_count())},
      {"poses",
       arguments.use_raw_poses ? "raw" : "optimized; newer nodes extended by odometry; raw before the first solve"}};
  if (reply.frame_of() != 0)
    notes.push_back({"frame", AgentName(team, reply.frame_of()) + "'s own frame, because the rover is not placed"});
  if (!reply.unplaced().empty()) notes.push_back({"not_placed", UnplacedNames(team, reply.unplaced())});
  return notes;
}

// Returns one line for each agent with maps or footprints that the export leaves out.
std::string LeftOutText(const proto::TeamConfig& team, const proto::MergeReply& reply) {
  std::string text;
  for (const proto::LeftOutItems& items : reply.left_out()) {
    const std::string name = AgentName(team, items.agent_id());
    const std::string repair = "; if the maps are wrong: moonctl map quarantine --agent " + name + "\n";
    if (items.far_count() > 0) {
      text += "excluded " + FormatCount(items.far_count()) + " maps and footprints of " + name + " that lie " +
              FormatFixed(items.distance_m(), 0) +
              " m or more from the team's centre, because the map would be too large" + repair;
    }
    if (items.without_room_count() > 0) {
      text += "excluded the oldest " + FormatCount(items.without_room_count()) + " maps and footprints of " + name +
              ", because they exceed its share of the merged map" + repair;
    }
  }
  return text;
}

std::string ExportText(const proto::TeamConfig& team, const MapExport& exported,
                       const std::vector<std::filesystem::path>& files, const proto::MergeReply& reply) {
  const Grid grid = WrittenMap(exported).grid;
  std::string text = "wrote";
  for (const std::filesystem::path& file : files) text += " " + file.string();
  text += ": " + std::to_string(grid.width) + " x " + std::to_string(grid.height) + " cells of " +
          FormatDouble(exported.map.resolution_um / 1e6) + " m, merged by " + reply.backend() + " in " +
          FormatFixed(reply.seconds(), 3) + " s\n";
  return text + NotesText(exported.notes) + UnplacedText(team, reply.frame_of(), reply.unplaced()) +
         CutText(team, reply.cut()) + LeftOutText(team, reply);
}

std::string ExportJson(const MapExport& exported, const std::vector<std::filesystem::path>& files,
                       const proto::MergeReply& reply) {
  JsonWriter json;
  json.BeginObject().Key("files").BeginArray();
  for (const std::filesystem::path& file : files) json.String(file.string());
  json.EndArray().Key("notes").WriteNotes(exported.notes).Key("merge").Raw(ToJson(reply)).EndObject();
  return json.text();
}

ExitCode ExportMap(CommandContext& context, const MapArguments& arguments) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  const proto::TeamConfig& config = (*team)->config;
  const auto request = MakeRequest(config, arguments);
  if (!request) return context.Report(request.error());
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto merged = target->client->Merge(*request);
  if (!merged) return context.Report(merged.error());
  if (merged->reply.map_count() == 0) {
    auto& unplaced = *merged->reply.mutable_unplaced();
    unplaced.erase(std::remove_if(unplaced.begin(), unplaced.end(),
                                  [](const proto::UnplacedRover& rover) { return rover.map_count() == 0; }),
                   unplaced.end());
    const std::string why = unplaced.empty() ? "; the leader and the designated survivor hold the team's maps"
                                             : ":\n" + UnplacedText(config, 0, unplaced);
    return context.Report({ErrorCode::kNotFound, target->agent->name() + " holds no map that can be placed" + why, {}});
  }
  MapExport exported{arguments.folder, arguments.format, std::move(merged->map), config.site(), {}};
  exported.notes = NotesOf(OriginOf(config, *target), NotesOn(config, arguments, merged->reply));
  const auto files = WriteMapFiles(exported);
  if (!files) return context.Report(files.error());
  return context.Done(ExportJson(exported, *files, merged->reply), ExportText(config, exported, *files, merged->reply));
}

}  // namespace

void AddMapCommands(Command& app, CommandContext& context) {
  Command& group = app.AddSubcommand("map", "Export, explain and check the merged map");
  group.RequireSubcommand();
  auto arguments = std::make_shared<MapArguments>();
  Command& exported = AddCommand(group, "export", "Merge the maps at the leader (or -a) and write the merged map",
                                 {"moonctl map export maps --format geotiff"});
  exported.AddOption("folder", arguments->folder, "Output folder; created if missing").TypeName("FOLDER").Required();
  exported
      .AddOption("--format", arguments->format,
                 "Format: nav2 (map.yaml and map.pgm), png (with a world file), or geotiff (on the Moon; see site in "
                 "the team file)")
      .OneOf({"nav2", "png", "geotiff"});
  exported.AddFlag("--raw-poses", arguments->use_raw_poses, "Ignore optimized poses");
  exported.AddOption("--agents", arguments->agents, "Merge only maps of these agents").TypeName("AGENT");
  exported.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return ExportMap(context, *arguments); }; });
  AddMapQuestions(group, context);
  AddMapOverlap(group, context);
}

}  // namespace moondb
