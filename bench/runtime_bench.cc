// runtime_bench: moondb's actor runtime against the C++ Actor Framework and against what the machine itself can do, in
// one run. What each case is and how to read it: docs/benchmarks/runtime.md.
//
// Exit code 0: all was measured; 1: a case failed, as when a message was lost; other: wrong arguments.
#include <fmt/core.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "bench/in_process.h"
#include "bench/report.h"

namespace moondb {
namespace {

int RunBench(const BenchOptions& options) {
  std::vector<Section> sections;
  for (const std::string& name : InProcessCases()) {
    const bool is_wanted = options.only.empty() || std::count(options.only.begin(), options.only.end(), name) > 0;
    if (!is_wanted) continue;
    const Result<Section> section = RunInProcessCase(name, options);
    if (!section) {
      fmt::print(stderr, "runtime_bench: {}: {}\n", name, section.error().text);
      return 1;
    }
    sections.push_back(*section);
    if (!options.is_json) fmt::print("{}\n", TableLine(*section));
    std::fflush(stdout);
  }
  if (options.is_json) fmt::print("{}", Json(sections));
  return 0;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::BenchOptions options;
  CLI::App app("Measures moondb's actor runtime beside other ways to do the same.", "runtime_bench");
  app.add_option("--only", options.only, "Only these cases")->check(CLI::IsMember(moondb::InProcessCases()));
  app.add_option("--messages", options.messages, "Messages of a repetition of the cheapest cases; others have a share")
      ->check(CLI::Range(1000, 1000000000))
      ->capture_default_str();
  app.add_option("--repeat", options.repetitions, "Repetitions; medians count")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_flag("--json", options.is_json, "One JSON object instead of a table");
  CLI11_PARSE(app, argc, argv);
  spdlog::set_level(spdlog::level::err);
  return moondb::RunBench(options);
}
