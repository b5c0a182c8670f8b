// The options of runtime_bench's command line.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace moondb {

struct BenchOptions {
  std::vector<std::string> only;     // Names of cases; empty: all.
  std::string contender;             // Only this one, for a profiler; empty: all.
  std::uint64_t messages = 5000000;  // Of one repetition of the cheapest cases; the others have a share of it.
  int repetitions = 5;
  int idle_seconds = 10;
  bool is_json = false;
};

}  // namespace moondb
