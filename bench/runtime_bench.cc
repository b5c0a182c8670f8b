// runtime_bench: compares moondb's actor runtime with the C++ Actor Framework, bare libzmq, and plain C++ without an
// actor library. docs/benchmarks/runtime.md describes the cases and the report.
//
// Exit code 0: all cases were measured; 1: a case failed, for example because a message was lost; other: wrong
// arguments.
#include <fmt/core.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "apps/common/arguments.h"
#include "bench/cases.h"
#include "bench/report.h"

namespace moondb {
namespace {

std::vector<std::string> CaseNames() {
  std::vector<std::string> names;
  for (const BenchCase& one : AllCases()) names.push_back(one.name);
  return names;
}

bool IsWanted(const std::string& name, const BenchOptions& options) {
  return options.only.empty() || std::count(options.only.begin(), options.only.end(), name) > 0;
}

int RunBench(const BenchOptions& options) {
  std::vector<Section> measured;
  for (const BenchCase& one : AllCases()) {
    if (!IsWanted(one.name, options)) continue;
    const Result<std::vector<Section>> sections = one.run(options);
    if (!sections) {
      fmt::print(stderr, "runtime_bench: {}: {}\n", one.name, sections.error().text);
      return 1;
    }
    for (const Section& section : *sections) {
      if (section.figures.empty()) continue;
      measured.push_back(section);
      if (!options.is_json) fmt::print("{}\n", TableOf(section));
    }
    std::fflush(stdout);
  }
  if (options.is_json) fmt::print("{}", Json(measured));
  return 0;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::BenchOptions options;
  moondb::Command app("runtime_bench", "Measures moondb's actor runtime beside other ways to do the same.");
  app.ShowDefaults();
  app.AddOption("--only", options.only, "Only these cases").OneOf(moondb::CaseNames());
  app.AddOption("--contender", options.contender, "Only this contender, for a profiler")
      .OneOf({"moondb", "caf", "limit", "raw", "raw_defaults"});
  app.AddOption("--messages", options.messages, "Messages of a repetition of the cheapest cases; others have a share")
      .Within(1000, 1000000000);
  app.AddOption("--repeat", options.repetitions, "Repetitions, of which the median counts").Within(1, 1000);
  app.AddOption("--idle-seconds", options.idle_seconds, "How long to watch an idle system").Within(1, 3600);
  app.AddFlag("--json", options.is_json, "One JSON object instead of a table");
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
  spdlog::set_level(spdlog::level::err);
  return moondb::RunBench(options);
}
