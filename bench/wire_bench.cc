// wire_bench: measures how many bytes whole missions and their maps take on the wire, as the paper's SQL statements and
// in moondb's compact encoding.
//
//   wire_bench [--recorded FOLDER]... [--json]
//
// Without --recorded, it measures the generated missions and, if $MOONDB_DATA is set, the recorded missions in that
// folder.
//
// Exit code 0: all missions were measured, and decoding restored them; 1: a mission could not be read or made; other:
// wrong arguments.
#include <fmt/core.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "apps/common/arguments.h"
#include "bench/wire_measure.h"

namespace moondb {
namespace {

struct Options {
  std::vector<std::string> recorded;
  bool is_json = false;
};

bool Measure(const Result<WireMission>& mission, std::vector<WireSizes>& sizes) {
  if (!mission) {
    fmt::print(stderr, "wire_bench: {}\n", ToString(mission.error()));
    return false;
  }
  sizes.push_back(MeasureMission(*mission));
  return true;
}

int RunBench(Options options) {
  const char* data = std::getenv("MOONDB_DATA");
  if (options.recorded.empty() && data != nullptr) {
    for (const char* name : {"intel_team", "orebro_team"}) options.recorded.push_back(std::string(data) + "/" + name);
  }
  std::vector<WireSizes> sizes;
  const WireMission rolling = MakeRollingMission();
  if (!Measure(rolling, sizes) || !Measure(MakeSingleViewMission(), sizes)) return 1;
  for (const std::string& folder : options.recorded) {
    if (!Measure(ReadRecordedMission(folder), sizes)) return 1;
  }
  const CodingTimes times = MeasureTimes(rolling);
  fmt::print("{}", options.is_json ? JsonOf(sizes, times) : TableOf(sizes, times));
  return 0;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::Options options;
  moondb::Command app("wire_bench", "Measures what missions take on the wire.");
  app.AddOption("--recorded", options.recorded, "Recorded missions to measure as well").ExistingFolder();
  app.AddFlag("--json", options.is_json, "One JSON object instead of a table");
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
  return moondb::RunBench(std::move(options));
}
