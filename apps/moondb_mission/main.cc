// moondb_mission: makes simulated lunar missions.
//
//   moondb_mission generate --seed 7 --out missions/seven [--minutes 10] [--rovers 3] [--side-m 40] ...
//
// Exit codes: 0 done, 1 failed, 2 wrong usage. Errors are one line on standard error.
#include <cstdio>
#include <string>

#include "apps/common/arguments.h"
#include "apps/moondb_mission/mission_maker.h"
#include "apps/picture/picture.h"
#include "model/metrics.h"

namespace moondb {
namespace {

struct Request {
  MissionOptions options;
  std::string folder;
  std::string picture;
};

int Complain(const std::string& text, int exit_code) {
  std::fprintf(stderr, "moondb_mission: %s\n", text.c_str());
  return exit_code;
}

double DrivenM(const Mission& mission) {
  double driven_m = 0;
  for (const OdometryEdge& edge : mission.graph.odometry) {
    driven_m += (mission.truth.at(edge.to).position_m - mission.truth.at(edge.from).position_m).norm();
  }
  return driven_m;
}

void PrintSummary(const MadeMission& made, const Request& request) {
  const Mission& mission = made.mission;
  const TrajectoryError error = CompareTrajectories(PosesOf(mission.graph), mission.truth, RoverIds(mission));
  std::printf("mission   %s (seed %llu)\n", request.folder.c_str(),
              static_cast<unsigned long long>(request.options.seed));
  std::printf("terrain   %g x %g m explored, %zu rocks from %g m, %zu craters from %g m\n",
              made.terrain.options().side_m, made.terrain.options().side_m, made.terrain.rocks().size(),
              made.terrain.options().rock_diameter_min_m, made.terrain.craters().size(),
              made.terrain.options().crater_diameter_min_m);
  std::printf("drives    %d rovers, %g min, %.0f m in all\n", request.options.rover_count, request.options.minutes,
              DrivenM(mission));
  std::printf("measured  %zu maps, %zu odometry steps, %zu ranges\n", mission.maps.size(),
              mission.graph.odometry.size(), mission.graph.ranges.size());
  std::printf("odometry  ATE %.2f m, at most %.2f m\n", error.rmse_m, error.max_m);
}

// Returns a picture of the terrain with the rovers' true tracks.
Picture PictureOf(const MadeMission& made, std::uint64_t seed) {
  std::vector<TrackAgent> rovers;
  for (const MissionAgent& agent : made.mission.agents) {
    if (!agent.is_base_station) rovers.push_back({agent.id, agent.name});
  }
  const std::string title = "Hazards and true tracks, seed " + std::to_string(seed);
  Picture picture;
  picture.panel_width_px = 1200;
  picture.panels = {{title, RasterOf(made.terrain.HazardMap()), TracksOf(made.mission.truth, rovers)}};
  return picture;
}

int Generate(const Request& request) {
  const Result<MadeMission> made = MakeMission(request.options);
  if (!made) return Complain(ToString(made.error()), made.error().code == ErrorCode::kInvalid ? 2 : 1);
  Result<void> done = WriteMadeMission(*made, request.folder);
  if (done && !request.picture.empty()) {
    done = WritePicture(PictureOf(*made, request.options.seed), request.picture);
  }
  if (!done) return Complain(ToString(done.error()), 1);
  PrintSummary(*made, request);
  return 0;
}

void AddGenerate(Command& app, Request& request) {
  MissionOptions& options = request.options;
  Command& command = app.AddSubcommand("generate", "Make a mission folder: agents.csv, graph.pyfg, maps.csv, maps/");
  command.AddOption("--seed", options.seed, "The same seed makes the same mission").Required();
  command.AddOption("--out", request.folder, "Folder to make; must be empty or absent").Required();
  command.AddOption("--minutes", options.minutes, "Length of the mission").DefaultShown();
  command.AddOption("--period-s", options.node_period_s, "Time between nodes").DefaultShown();
  command.AddOption("--rovers", options.rover_count, "Number of rovers, 1 to 8").DefaultShown();
  command.AddOption("--side-m", options.terrain.side_m, "Side of the explored square").DefaultShown();
  command.AddOption("--rock-share", options.terrain.rock_area_share, "Fraction of the surface that rocks cover")
      .DefaultShown();
  command.AddOption("--crater-share", options.terrain.crater_share, "Craters against the lunar equilibrium")
      .DefaultShown();
  command.AddOption("--picture", request.picture, "Also draw hazards and true tracks into this .png or .svg file");
}

int Main(int argc, char** argv) {
  Command app("moondb_mission", "Makes simulated lunar missions for moondb.");
  app.RequireSubcommand();
  Request request;
  AddGenerate(app, request);
  if (const std::optional<ParseStop> stop = app.Parse(argc, argv)) {
    return stop->exit_code == 0 ? 0 : Complain(stop->error + " (see --help)", 2);
  }
  return Generate(request);
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) { return moondb::Main(argc, argv); }
