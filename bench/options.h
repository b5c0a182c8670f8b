// The options of runtime_bench's command line.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace moondb {

struct BenchOptions {
  std::vector<std::string> only;     // Names of cases; empty for all.
  std::string contender;             // The only one to run, for a profiler; empty for all.
  std::uint64_t messages = 5000000;  // Messages per repetition of the cheapest cases; others have a fraction.
  int repetitions = 5;
  int idle_seconds = 10;
  bool is_json = false;
};

}  // namespace moondb
