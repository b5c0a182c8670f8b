// merge_bench: compares moondb's merger with a naive merger, OpenCV and the paper's painter on OpenGL, in one run (the
// paper's figure 7). docs/benchmarks/merging.md describes the contenders and the report.
//
// Exit code 0: all contenders were measured and their maps agree; 1: a contender failed or maps differ; other: wrong
// arguments.
#include <fmt/core.h>
#include <spdlog/spdlog.h>

#include <cstdio>
#include <string>
#include <vector>

#include "actors/merge/gather_pool.h"
#include "apps/common/arguments.h"
#include "bench/carried_merge.h"
#include "bench/merge_contest.h"
#include "bench/merge_plot.h"
#include "bench/merge_report.h"

namespace moondb {
namespace {

struct Options {
  std::vector<std::size_t> maps = {10, 30, 100, 300, 1000};
  std::int64_t side_cells = 2000;
  std::vector<std::int64_t> growth_sides;
  int repetitions = 5;
  int threads = HardwareThreads();
  bool is_json = false;
  std::string plot;
};

Result<MergeRun> RunOne(std::size_t maps, std::int64_t side_cells, const Options& options) {
  MergeContestOptions contest;
  contest.maps = maps;
  contest.side_cells = side_cells;
  contest.repetitions = options.repetitions;
  contest.threads = options.threads;
  Result<MergeRun> run = RunMergeContest(contest);
  if (run && maps > kCarriedNodes) {
    const Result<CarriedMerge> carried =
        MeasureCarriedMerge(MakeMergeWorld(maps, side_cells, /*seed=*/1), options.repetitions);
    if (!carried) return tl::unexpected(carried.error());
    run->record_map_ms = carried->new_map_ms;
    run->record_pose_ms = carried->moved_pose_ms;
  }
  if (run && !options.is_json) fmt::print("{}\n", TableOf({*run}));
  std::fflush(stdout);
  return run;
}

int RunBench(const Options& options) {
  std::vector<MergeRun> runs;
  std::vector<MergeRun> growth;
  const auto run_into = [&options](std::vector<MergeRun>& all, std::size_t maps, std::int64_t side_cells) {
    Result<MergeRun> run = RunOne(maps, side_cells, options);
    if (!run) {
      fmt::print(stderr, "merge_bench: {} maps: {}\n", maps, run.error().text);
      return false;
    }
    all.push_back(*std::move(run));
    return true;
  };
  for (const std::size_t maps : options.maps) {
    if (!run_into(runs, maps, options.side_cells)) return 1;
  }
  for (const std::int64_t side_cells : options.growth_sides) {
    if (!run_into(growth, 100, side_cells)) return 1;
  }
  if (options.is_json) fmt::print("{}", JsonOf(runs, growth));
  if (options.plot.empty()) return 0;
  const Result<void> written = WritePlot(runs, options.plot);
  if (!written) fmt::print(stderr, "merge_bench: {}: {}\n", options.plot, written.error().text);
  return written ? 0 : 1;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::Options options;
  moondb::Command app("merge_bench", "Measures moondb's merger beside other ways to merge local maps.");
  app.ShowDefaults();
  app.AddOption("--maps", options.maps, "Numbers of maps").Within(1, 10000);
  app.AddOption("--side", options.side_cells, "Side of the square in which all that is known lies, in cells of 5 cm")
      .Within(1024, 16000);
  app.AddOption("--growth", options.growth_sides, "Also 100 maps in squares of these sides").Within(1024, 16000);
  app.AddOption("--repeat", options.repetitions, "Repetitions, of which the median counts").Within(1, 1000);
  app.AddOption("--threads", options.threads, "Threads of the CPU's full merge").Within(1, 64);
  app.AddFlag("--json", options.is_json, "One JSON object instead of a table");
  app.AddOption("--plot", options.plot, "Writes a PNG picture of the times here");
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
  spdlog::set_level(spdlog::level::err);
  return moondb::RunBench(options);
}
