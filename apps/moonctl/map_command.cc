#include <CLI/CLI.hpp>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/map_questions.h"
#include "model/map_picture.h"
#include "model/png.h"
#include "model/ros_map.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr char kBaseName[] = "map";

struct MapArguments {
  std::string folder;
  std::string format = "ros";
  bool use_raw_poses = false;
  std::vector<std::string> agents;
};

Result<void> WriteMap(const MapArguments& arguments, const MergedMap& map) {
  const std::filesystem::path folder(arguments.folder);
  if (arguments.format == "ros") return WriteRosMap(map, folder, kBaseName);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return Fail(ErrorCode::kInternal, "cannot make the folder: " + error.message(), folder.string());
  return WritePng(DrawMap(map, {}), folder / (std::string(kBaseName) + ".png"));
}

ExitCode ExportMap(CommandContext& context, const MapArguments& arguments) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  proto::MergeRequest request;
  request.set_use_raw_poses(arguments.use_raw_poses);
  for (const std::string& name : arguments.agents) {
    auto agent = AgentNamed((*team)->config, name);
    if (!agent) return context.Report(agent.error());
    request.add_agents((*agent)->id());
  }
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  auto merged = target->client->Merge(request);
  if (!merged) return context.Report(merged.error());
  if (merged->map.grid.cells.empty()) {
    return context.Report({ErrorCode::kNotFound, target->agent->name() + " holds no map that can be placed", {}});
  }
  if (auto written = WriteMap(arguments, merged->map); !written) return context.Report(written.error());

  const Grid& grid = merged->map.grid;
  const std::string text = "wrote " + arguments.folder + ": " + std::to_string(grid.width) + " x " +
                           std::to_string(grid.height) + " cells of " + FormatDouble(merged->map.resolution_um / 1e6) +
                           " m, " + FormatCount(merged->reply.map_count()) + " maps merged by " +
                           merged->reply.backend() + " in " + FormatFixed(merged->reply.seconds(), 3) + " s" +
                           (merged->reply.waiting_map_count() > 0
                                ? ", " + FormatCount(merged->reply.waiting_map_count()) + " wait for their nodes"
                                : "");
  return context.Done(ToJson(merged->reply), text);
}

}  // namespace

void AddMapCommands(CLI::App& app, CommandContext& context) {
  CLI::App& group = *app.add_subcommand("map", "The merged map");
  group.require_subcommand(1);
  auto arguments = std::make_shared<MapArguments>();
  CLI::App& exported = *group.add_subcommand("export", "Merge at the leader (or -a) and write the map");
  exported.add_option("folder", arguments->folder, "Made if it is missing")->type_name("FOLDER")->required();
  exported.add_option("--format", arguments->format, "ros (map.yaml and map.pgm) or png (a picture)")
      ->check(CLI::IsMember({"ros", "png"}));
  exported.add_flag("--raw-poses", arguments->use_raw_poses, "Ignore optimized poses");
  exported.add_option("--agents", arguments->agents, "Maps of these agents only")->type_name("AGENT");
  exported.callback(
      [&context, arguments] { context.action = [&context, arguments] { return ExportMap(context, *arguments); }; });
  AddMapQuestions(group, context);
}

}  // namespace moondb
