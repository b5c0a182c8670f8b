// Command line options of runtime_bench.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace moondb {

struct BenchOptions {
  std::vector<std::string> only;  // Names of cases; empty for all.
  std::string contender;          // If not empty, only this contender runs (useful with a profiler).
  // Messages per repetition of the cheapest cases. Other cases use a fraction of this number.
  std::uint64_t messages = 5000000;
  int repetitions = 5;
  int idle_seconds = 10;
  bool is_json = false;
};

}  // namespace moondb
