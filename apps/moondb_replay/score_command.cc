#include "apps/moondb_replay/score_command.h"

#include <algorithm>
#include <cstdio>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/common/team_clients.h"
#include "apps/moondb_replay/map_frame.h"
#include "apps/moondb_replay/score.h"
#include "model/map_picture.h"
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

std::vector<AgentId> AgentsOf(const proto::TeamConfig& team) {
  std::vector<AgentId> agents;
  for (const proto::AgentConfig& agent : team.agents()) agents.push_back(agent.id());
  return agents;
}

std::string Caption(const std::string& what, const TrajectoryError& error, const MapAgreement& agreement) {
  return what + ": ATE " + FormatFixed(error.rmse_m, 2) + " m, hazard IoU " + FormatFixed(agreement.hazard_iou, 2);
}

// Returns the tracks of the rovers. The base station has no track.
std::vector<Track> RoverTracks(const Setting& setting, const Poses& poses) {
  return TracksOf(poses, AgentsOf(setting.team.config));
}

Result<void> WriteRovers(const Setting& setting, const std::filesystem::path& out) {
  const std::vector<Track> tracks = RoverTracks(setting, NewestPoses(setting.held));
  for (int place = 0; place < setting.team.config.agents_size(); ++place) {
    const proto::AgentConfig& agent = setting.team.config.agents(place);
    if (agent.kind() != proto::AGENT_KIND_ROVER) continue;
    auto merged = MergeAt(setting.team.config, setting.held, NewestPoses(setting.held), agent.id());
    if (!merged) return tl::unexpected(merged.error());
    const bool has_map = std::any_of(setting.held.maps.begin(), setting.held.maps.end(),
                                     [&agent](const HeldMap& map) { return map.key.stream.origin == agent.id(); });
    if (!has_map) continue;
    MapPictureOptions options;
    options.caption = agent.name();
    const Image image = DrawMap(*merged, {tracks[static_cast<std::size_t>(place)]}, options);
    if (auto written = WritePng(image, out / (agent.name() + ".png")); !written) return written;
  }
  return {};
}

Result<void> WritePictures(const Setting& setting, const std::filesystem::path& out) {
  const Poses raw = RawPoses(setting.held);
  const Poses newest = NewestPoses(setting.held);
  const ScoredMaps& maps = setting.scored.maps;
  const Score& score = setting.scored.score;
  const std::vector<Track> before = RoverTracks(setting, raw);
  const std::vector<Track> after = RoverTracks(setting, newest);
  const std::vector<Track> truth = RoverTracks(setting, setting.mission.truth);

  // All pictures have one frame, so each place is at the same pixel in all of them.
  const MergedMap* all[] = {&maps.before, &maps.after, &maps.truth};
  const MapFrame frame = FrameOf(all, kPictureMarginCells);
  MapPictureOptions options;
  options.is_cropped = false;
  options.caption = Caption("odometry", score.before, score.map_before);
  const Image picture_before = DrawMap(InFrame(maps.before, frame), before, options);
  options.caption = Caption("optimized", score.after, score.map_after);
  const Image picture_after = DrawMap(InFrame(maps.after, frame), after, options);
  options.caption = "truth";
  const Image picture_truth = DrawMap(InFrame(maps.truth, frame), truth, options);
  TrajectoryPlotOptions plot;
  plot.caption = "trajectories: truth pale, odometry grey, optimized coloured";

  const std::pair<const char*, Image> pictures[] = {{"merged_before.png", picture_before},
                                                    {"merged_after.png", picture_after},
                                                    {"merged_truth.png", picture_truth},
                                                    {"before_after.png", SideBySide(picture_before, picture_after)},
                                                    {"trajectories.png", DrawTrajectories(before, after, truth, plot)}};
  for (const auto& [name, picture] : pictures) {
    if (auto written = WritePng(picture, out / name); !written) return written;
  }
  return WriteRovers(setting, out);
}

void WritePart(JsonWriter& json, const char* name, const TrajectoryError& error, const MapAgreement& agreement) {
  json.Key(name).BeginObject();
  json.Key("ate_m").Number(error.rmse_m).Key("max_error_m").Number(error.max_m);
  json.Key("hazard_precision").Number(agreement.precision).Key("hazard_recall").Number(agreement.recall);
  json.Key("hazard_iou").Number(agreement.hazard_iou).Key("kappa").Number(agreement.kappa).EndObject();
}

std::string FiguresAsJson(const Setting& setting, const std::string& agent) {
  const Score& score = setting.scored.score;
  JsonWriter json;
  json.BeginObject().Key("agent").String(agent);
  json.Key("node_count").Number(static_cast<double>(score.before.node_count));
  json.Key("map_count").Number(static_cast<double>(score.map_count));
  json.Key("optimized_pose_count").Number(static_cast<double>(score.optimized_count));
  WritePart(json, "before", score.before, score.map_before);
  WritePart(json, "after", score.after, score.map_after);
  json.Key("is_agents_map_equal").Bool(score.is_agents_map_equal);
  json.Key("agents_merge_s").Number(setting.agent_merge_s);
  json.Key("agents_merge_backend").String(setting.agent_backend).EndObject();
  return json.text() + "\n";
}

void PrintFigures(const Setting& setting, const std::string& agent) {
  const Score& score = setting.scored.score;
  Table table({"", "ATE M", "MAX M", "HAZARD IOU", "KAPPA"});
  const auto add = [&table](const char* name, const TrajectoryError& error, const MapAgreement& agreement) {
    table.Add({name, FormatFixed(error.rmse_m, 3), FormatFixed(error.max_m, 3), FormatFixed(agreement.hazard_iou, 3),
               FormatFixed(agreement.kappa, 3)});
  };
  add("before (odometry)", score.before, score.map_before);
  add("after (optimized)", score.after, score.map_after);
  std::printf("%s holds %zu nodes (%zu optimized) and %zu maps\n%s", agent.c_str(), score.before.node_count,
              score.optimized_count, score.map_count, table.Text().c_str());
  std::printf("its own merged map (%s, %.3f s) %s the one merged here\n", setting.agent_backend.c_str(),
              setting.agent_merge_s, score.is_agents_map_equal ? "equals" : "DIFFERS FROM");
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
  auto scored = ScoreHeld(setting.team.config, setting.mission, setting.held, merged->map);
  if (!scored) return tl::unexpected(scored.error());
  setting.scored = std::move(*scored);
  return setting;
}

}  // namespace

Result<void> ScoreAgent(const ScoreArguments& arguments) {
  std::error_code error;
  std::filesystem::create_directories(arguments.out, error);
  if (error) return Fail(ErrorCode::kInternal, "cannot make the folder: " + error.message(), arguments.out);
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
