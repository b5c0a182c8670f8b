// pgo_bench: compares the pose graph solver with simpler methods, on graph files of a folder and on simulated teams.
// docs/benchmarks/pose_graph.md describes the methods and the report.
//
// Exit code 0: all graphs were solved; 1: a graph could not be read or no solution was found; other: wrong arguments.
#include <fmt/core.h>
#include <spdlog/spdlog.h>

#include <cstdio>
#include <string>
#include <vector>

#include "apps/common/arguments.h"
#include "apps/picture/picture.h"
#include "bench/pgo_closures.h"
#include "bench/pgo_graphs.h"
#include "bench/pgo_lies.h"
#include "bench/pgo_redraws.h"
#include "bench/pgo_registration.h"
#include "bench/pgo_report.h"
#include "bench/pgo_team.h"

namespace moondb {
namespace {

struct Options {
  std::vector<std::string> folders;
  int threads = 2;
  int seeds = 0;
  int redraws = 0;
  int unknown_starts = 0;
  bool has_closures = false;
  bool has_registration = false;
  bool has_lies = false;
  std::string only;  // If not empty, only team cases and lies whose name contains this text run.
  bool is_json = false;
  bool is_ours_only = false;
  std::string plots;
};

bool PlotTracks(const std::string& title, std::vector<Track> tracks, const std::filesystem::path& file) {
  Picture picture;
  picture.panel_width_px = 900;
  picture.panels = {{title, {}, std::move(tracks)}};
  const Result<void> written = WritePicture(picture, file);
  if (!written) fmt::print(stderr, "pgo_bench: {}\n", ToString(written.error()));
  return written.has_value();
}

bool Plot(const GraphRun& run, const std::filesystem::path& folder) {
  const char* before = run.is_team ? "odometry" : "least squares";
  return PlotTracks(run.name, ComparedTracks(run.true_tracks, run.odometry_tracks, before, run.tracks),
                    folder / (run.name + ".png"));
}

int RunBench(const Options& options) {
  bool is_good = true;
  std::vector<GraphRun> graphs;
  std::vector<RedrawRun> redraws;
  std::vector<ClosureRun> closures;
  std::vector<RegistrationRun> registrations;
  std::vector<LieRun> lies;
  SolverOptions solver;
  solver.thread_count = options.threads;
  for (const std::string& folder : options.folders) {
    for (const std::filesystem::path& path : FindGraphs(folder)) {
      Result<GraphRun> run = RunGraph(path, {solver, !options.is_ours_only});
      if (!run) {
        fmt::print(stderr, "pgo_bench: {}\n", ToString(run.error()));
        is_good = false;
        continue;
      }
      is_good = is_good && run->ours.has_converged;
      if (!options.plots.empty()) is_good = Plot(*run, options.plots) && is_good;
      if (run->is_team &&
          (options.redraws > 0 || options.has_closures || options.has_registration || options.has_lies)) {
        // RunGraph has just read the mission, but its files may have been removed since.
        const auto mission = ReadMission(path);
        is_good = is_good && mission;
        if (!mission) continue;
        if (options.redraws > 0)
          redraws.push_back(RunRedraws(run->name, *mission, options.redraws, options.has_registration, solver));
        if (options.has_registration) {
          const std::vector<RegistrationRun> of_mission = RunRegistration(run->name, *mission, solver);
          registrations.insert(registrations.end(), of_mission.begin(), of_mission.end());
        }
        if (options.has_lies) {
          const std::vector<LieRun> of_mission = RunLies(run->name, *mission, solver, options.only);
          lies.insert(lies.end(), of_mission.begin(), of_mission.end());
        }
        if (options.has_closures) {
          const std::vector<ClosureRun> of_mission = RunClosures(run->name, *mission, solver);
          closures.insert(closures.end(), of_mission.begin(), of_mission.end());
        }
        if (options.has_closures && !options.plots.empty()) {
          const auto file = std::filesystem::path(options.plots) / (run->name + ".factors.png");
          is_good = PlotTracks(run->name, FactorTracks(*mission, solver), file) && is_good;
        }
      }
      graphs.push_back(*std::move(run));
    }
  }
  if (!options.is_json && !graphs.empty()) fmt::print("{}\n", TableOf(graphs));
  if (!options.is_json)
    fmt::print("{}{}{}{}", TableOf(redraws), TableOf(closures), TableOf(registrations), TableOf(lies));
  std::vector<TeamRun> teams;
  for (const TeamCase& team : StandardTeamCases()) {
    if (options.seeds == 0 || team.name.find(options.only) == std::string::npos) continue;
    teams.push_back(RunTeam(team, options.seeds, solver));
    if (!options.is_json) fmt::print("{}", TableOf(std::vector<TeamRun>{teams.back()}));
    std::fflush(stdout);
  }
  UnknownStartsRun unknown;
  if (options.unknown_starts > 0) unknown = RunUnknownStarts(options.unknown_starts, solver);
  if (options.unknown_starts > 0 && !options.is_json) fmt::print("{}", TextOf(unknown));
  if (options.is_json) fmt::print("{}", JsonOf(graphs, redraws, closures, registrations, lies, teams, unknown));
  return is_good ? 0 : 1;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::Options options;
  moondb::Command app("pgo_bench", "Measures the pose graph solver on public graphs, missions and simulated teams.");
  app.ShowDefaults();
  app.AddOption("folders", options.folders, "Folders with .g2o and .pyfg files, or missions (agents.csv)")
      .ExistingFolder();
  app.AddOption("--threads", options.threads, "Threads of each solve").Within(1, 64);
  app.AddOption("--seeds", options.seeds, "Also simulated teams with the seeds 1 to this").Within(0, 1000);
  app.AddOption("--redraws", options.redraws, "Also each mission with this many redraws of its noise").Within(0, 1000);
  app.AddOption("--unknown-starts", options.unknown_starts,
                "Also so many simulated teams in which two rovers do not know where they began")
      .Within(0, 1000);
  app.AddFlag("--closures", options.has_closures, "Also each mission with drawn loop closures, some of them wrong");
  app.AddFlag("--registration", options.has_registration, "Also each mission with matches of its maps");
  app.AddFlag("--lies", options.has_lies, "Also each mission with one rover that inserts false records");
  app.AddOption("--only", options.only, "Run only simulated teams, and lies, whose name contains this text");
  app.AddFlag("--json", options.is_json, "One JSON object instead of a table");
  app.AddFlag("--ours-only", options.is_ours_only, "Without plain least squares from odometry beside each graph");
  app.AddOption("--plots", options.plots, "Writes a PNG picture of each graph's trajectories into this folder")
      .ExistingFolder();
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
  spdlog::set_level(spdlog::level::err);
  return moondb::RunBench(options);
}
