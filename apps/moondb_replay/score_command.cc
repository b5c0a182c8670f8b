#include "apps/moondb_replay/score_command.h"

#include <algorithm>
#include <cstdio>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/common/team_clients.h"
#include "apps/moondb_replay/map_frame.h"
#include "apps/moondb_replay/score.h"
#include "apps/picture/picture.h"
#include "model/file_writing.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr std::int64_t kPictureMarginCells = 20;

struct Setting {
  TeamFile team;
  Mission mission;
  Held held;
  Scored scored;
  double agent_merge_s = 0;
  std::string agent_backend;
};

std::string Title(const std::string& what, const ScoredPoses& scored) {
  return what + ": ATE " + FormatFixed(scored.error.rmse_m, 2) + " m, hazard IoU " +
         FormatFixed(scored.agreement.hazard_iou, 2);
}

// Returns the tracks of all agents, in the team's order. The base station's track is one point.
std::vector<Track> TeamTracks(const Setting& setting, const Poses& poses) {
  std::vector<TrackAgent> agents;
  for (const proto::AgentConfig& agent : setting.team.config.agents()) agents.push_back({agent.id(), agent.name()});
  return TracksOf(poses, agents);
}

Picture NewPicture(const Setting& setting, int panel_width_px) {
  Picture picture;
  picture.panel_width_px = panel_width_px;
  if (setting.team.config.has_site()) picture.north_yaw_rad = setting.team.config.site().north_yaw_rad();
  return picture;
}

// Writes NAME.png and NAME.svg.
Result<void> WriteBoth(const Picture& picture, const std::filesystem::path& folder, const std::string& name) {
  if (auto written = WritePicture(picture, folder / (name + ".png")); !written) return written;
  return WritePicture(picture, folder / (name + ".svg"));
}

// Compares a map with the true map, cell by cell. Returns kInvalid if the two maps do not cover the same cells.
Result<Raster> ComparisonRaster(const MergedMap& map, const MergedMap& truth) {
  const auto matches = MatchHazardCells(map, truth);
  if (!matches) return tl::unexpected(matches.error());
  Raster raster = RasterOf(map);
  for (std::size_t i = 0; i < matches->size(); ++i) raster.cells[i] = static_cast<std::uint8_t>((*matches)[i]);
  // The classes are in the order of HazardMatch's values.
  raster.classes = {raster.classes[0],
                    raster.classes[1],
                    {{20, 20, 20}, "hazard, right"},
                    {{0, 90, 160}, "hazard, missed"},
                    {{240, 150, 30}, "hazard, phantom"}};
  return raster;
}

Result<void> WriteRovers(const Setting& setting, const std::filesystem::path& out) {
  const Poses& poses = setting.scored.after.poses;
  const std::vector<Track> tracks = TeamTracks(setting, poses);
  for (int place = 0; place < setting.team.config.agents_size(); ++place) {
    const proto::AgentConfig& agent = setting.team.config.agents(place);
    if (agent.kind() != proto::AGENT_KIND_ROVER) continue;
    auto merged = MergeAt(setting.team.config, setting.held, poses, agent.id());
    if (!merged) return tl::unexpected(merged.error());
    const bool has_map = std::any_of(setting.held.maps.begin(), setting.held.maps.end(),
                                     [&agent](const HeldMap& map) { return map.key.stream.origin == agent.id(); });
    if (!has_map) continue;
    Picture picture = NewPicture(setting, 1200);
    picture.panels = {{"Maps of " + agent.name(),
                       RasterOf(CroppedToKnown(*merged, kPictureMarginCells)),
                       {tracks[static_cast<std::size_t>(place)]}}};
    if (auto written = WriteBoth(picture, out, agent.name()); !written) return written;
  }
  return {};
}

Result<void> WritePictures(const Setting& setting, const std::filesystem::path& out) {
  const Scored& scored = setting.scored;
  const std::vector<Track> before = TeamTracks(setting, scored.before.poses);
  const std::vector<Track> after = TeamTracks(setting, scored.after.poses);
  const std::vector<Track> truth = TeamTracks(setting, setting.mission.truth);

  // All pictures show the same part of the frame `map`.
  std::vector<const MergedMap*> all = {&scored.before.map, &scored.after.map, &scored.truth};
  if (scored.without_matches) all.push_back(&scored.without_matches->map);
  const MapFrame frame = FrameOf(all, kPictureMarginCells);
  const MergedMap map_truth = InFrame(scored.truth, frame);
  const std::string title_before = Title("Odometry", scored.before);
  const std::string title_after = Title(scored.without_matches ? "With matches" : "Optimized", scored.after);
  std::vector<Panel> compared;
  const auto add_compared = [&](const std::string& title, const ScoredPoses& poses) -> Result<void> {
    auto raster = ComparisonRaster(InFrame(poses.map, frame), map_truth);
    if (!raster) return tl::unexpected(raster.error());
    compared.push_back({title, *std::move(raster), {}});
    return {};
  };
  const Panel panel_after = {title_after, RasterOf(InFrame(scored.after.map, frame)), after};
  if (auto added = add_compared(title_before, scored.before); !added) return added;
  if (scored.without_matches) {
    auto added = add_compared(Title("Optimized", *scored.without_matches), *scored.without_matches);
    if (!added) return added;
  } else {
    compared.insert(compared.begin(), {"Merged map at optimized poses", panel_after.raster, panel_after.tracks});
  }
  if (auto added = add_compared(title_after, scored.after); !added) return added;

  const std::pair<const char*, std::vector<Panel>> pictures[] = {
      {"merged_before", {{title_before, RasterOf(InFrame(scored.before.map, frame)), before}}},
      {"merged_after", {panel_after}},
      {"merged_truth", {{"Merged at the true poses", RasterOf(map_truth), truth}}},
      {"before_after", compared},
      {"trajectories", {{"Tracks", {}, ComparedTracks(truth, before, "odometry", after)}}}};
  for (const auto& [name, panels] : pictures) {
    Picture picture = NewPicture(setting, panels.size() == 1 ? 1200 : 760);
    picture.panels = panels;
    if (auto written = WriteBoth(picture, out, name); !written) return written;
  }
  return WriteRovers(setting, out);
}

void WritePart(JsonWriter& json, const char* name, const ScoredPoses& scored) {
  const MapAgreement& agreement = scored.agreement;
  json.Key(name).BeginObject();
  json.Key("ate_m").Number(scored.error.rmse_m).Key("max_error_m").Number(scored.error.max_m);
  json.Key("hazard_precision").Number(agreement.precision).Key("hazard_recall").Number(agreement.recall);
  json.Key("hazard_iou").Number(agreement.hazard_iou).Key("kappa").Number(agreement.kappa).EndObject();
}

std::string FiguresAsJson(const Setting& setting, const std::string& agent) {
  const Scored& scored = setting.scored;
  JsonWriter json;
  json.BeginObject().Key("agent").String(agent);
  json.Key("node_count").Number(static_cast<double>(scored.before.error.node_count));
  json.Key("map_count").Number(static_cast<double>(scored.map_count));
  json.Key("optimized_pose_count").Number(static_cast<double>(scored.optimized_count));
  WritePart(json, "before", scored.before);
  if (scored.without_matches) WritePart(json, "without_matches", *scored.without_matches);
  WritePart(json, "after", scored.after);
  json.Key("area_ratio").Number(scored.area_ratio);
  json.Key("is_agents_map_equal").Bool(scored.is_agents_map_equal);
  json.Key("agents_merge_s").Number(setting.agent_merge_s);
  json.Key("agents_merge_backend").String(setting.agent_backend).EndObject();
  return json.text() + "\n";
}

void PrintFigures(const Setting& setting, const std::string& agent) {
  const Scored& scored = setting.scored;
  Table table({"", "ATE M", "MAX M", "HAZARD IOU", "KAPPA"});
  const auto add = [&table](const char* name, const ScoredPoses& poses) {
    table.Add({name, FormatFixed(poses.error.rmse_m, 3), FormatFixed(poses.error.max_m, 3),
               FormatFixed(poses.agreement.hazard_iou, 3), FormatFixed(poses.agreement.kappa, 3)});
  };
  add("before (odometry)", scored.before);
  if (scored.without_matches) add("optimized without map matches", *scored.without_matches);
  add(scored.without_matches ? "after (optimized with map matches)" : "after (optimized)", scored.after);
  std::printf("%s holds %zu nodes (%zu optimized) and %zu maps\n%s", agent.c_str(), scored.before.error.node_count,
              scored.optimized_count, scored.map_count, table.Text().c_str());
  std::printf("its map shows %s %% of the area that the robots mapped in the whole mission\n",
              FormatFixed(100 * scored.area_ratio, 1).c_str());
  std::printf("its own merged map (%s, %.3f s) %s the one merged here\n", setting.agent_backend.c_str(),
              setting.agent_merge_s, scored.is_agents_map_equal ? "equals" : "DIFFERS FROM");
}

Result<Setting> Gather(const ScoreArguments& arguments) {
  Setting setting;
  auto team = ReadTeamFile(arguments.team);
  if (!team) return tl::unexpected(team.error());
  setting.team = std::move(*team);
  auto agent = AgentNamed(setting.team.config, arguments.agent);
  if (!agent) return tl::unexpected(agent.error());
  auto mission = ReadMission(arguments.mission);
  if (!mission) return tl::unexpected(mission.error());
  setting.mission = std::move(*mission);
  auto client = ConnectTo(setting.team, **agent,
                          {.connect_timeout = std::chrono::seconds(10), .timeout = std::chrono::seconds(60)});
  if (!client) return tl::unexpected(client.error());
  auto held = ReadHeld(**client, setting.team.config);
  if (!held) return tl::unexpected(held.error());
  setting.held = std::move(*held);
  auto merged = (*client)->Merge({});
  if (!merged) return tl::unexpected(merged.error());
  setting.agent_merge_s = merged->reply.seconds();
  setting.agent_backend = merged->reply.backend();
  auto scored = ScoreHeld(setting.team.config, setting.mission, setting.held, merged->map, arguments.is_aligned);
  if (!scored) return tl::unexpected(scored.error());
  setting.scored = std::move(*scored);
  return setting;
}

}  // namespace

Result<void> ScoreAgent(const ScoreArguments& arguments) {
  if (const std::error_code error = MakeFolders(arguments.out)) {
    return Fail(ErrorCode::kInternal, "cannot make the folder: " + error.message(), arguments.out);
  }
  auto setting = Gather(arguments);
  if (!setting) return tl::unexpected(setting.error());
  if (auto written = WritePictures(*setting, arguments.out); !written) return written;
  if (!arguments.json.empty()) {
    auto written = WriteTextFile(arguments.json, FiguresAsJson(*setting, arguments.agent));
    if (!written) return written;
  }
  PrintFigures(*setting, arguments.agent);
  return {};
}

}  // namespace moondb
