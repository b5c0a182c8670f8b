// All cases of runtime_bench, under the names that --only takes.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bench/measure.h"
#include "bench/options.h"
#include "model/error.h"

namespace moondb {

struct BenchCase {
  std::string name;
  std::function<Result<std::vector<Section>>(const BenchOptions& options)> run;
};

// A contest of one number.
BenchCase AsCase(Contest contest);

// All of the following, in the order in which they are to be run.
std::vector<BenchCase> AllCases();

// How far the resident memory grows while messages flow. To be run first: later the heap holds what others freed.
std::vector<BenchCase> MemoryCases();
// Within one process: moondb, CAF (where this build has it) and the limit, in turn.
std::vector<BenchCase> InProcessCases();
// Between two agents over loopback TCP: moondb and libzmq alone, in turn.
std::vector<BenchCase> RemoteCases();
// What a system costs that has nothing to do.
std::vector<BenchCase> IdleCases();

}  // namespace moondb
