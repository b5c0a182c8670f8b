// start_bench: searches for rovers that started anywhere in recorded missions, and across them.
// docs/benchmarks/pose_graph.md describes the report.
//
// Exit code 0: no rover was placed wrongly; 1: a rover was, or a mission could not be read; other: wrong arguments.
#include <fmt/core.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "apps/common/arguments.h"
#include "bench/dense_drives.h"
#include "bench/start_runs.h"

int main(int argc, char** argv) {
  std::vector<std::string> folders;
  int draws = 0;
  bool is_json = false;
  bool is_dense = false;
  moondb::Command app("start_bench", "Searches for rovers that started anywhere in missions, and across them.");
  app.ShowDefaults();
  app.AddOption("folders", folders, "Missions (agents.csv)").ExistingFolder();
  app.AddOption("--draws", draws, "Also with this many further draws of the odometry's noise").Within(0, 1000);
  app.AddFlag("--dense", is_dense, "Match 2,394 maps of one building, one each 0.2 m, instead");
  app.AddFlag("--json", is_json, "One JSON list instead of text");
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
  if (is_dense) {
    fmt::print("{}", moondb::TextOf(moondb::MatchDenseDrives()));
    return 0;
  }
  std::vector<moondb::Mission> missions;
  for (const std::string& folder : folders) {
    auto mission = moondb::ReadMission(folder);
    if (!mission) {
      fmt::print(stderr, "start_bench: {}\n", ToString(mission.error()));
      return 1;
    }
    missions.push_back(*std::move(mission));
  }
  const std::vector<moondb::AnywhereRun> runs = moondb::RunAnywhere(missions, draws);
  fmt::print("{}\n", is_json ? JsonOf(runs) : TextOf(runs));
  return std::ranges::any_of(runs, &moondb::AnywhereRun::is_wrong) ? 1 : 0;
}
