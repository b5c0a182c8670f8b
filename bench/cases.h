// All cases of runtime_bench, under the names that --only accepts.
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

// Wraps a contest whose result is one number.
BenchCase AsCase(Contest contest);

// Returns all cases below, in the order in which to run them.
std::vector<BenchCase> AllCases();

// Growth of the resident memory while messages flow. Run these cases first: later, the heap contains memory that other
// cases freed.
std::vector<BenchCase> MemoryCases();
// Cases within one process: moondb, CAF (if this build has it) and the limit, in turn.
std::vector<BenchCase> InProcessCases();
// Cases between two agents over loopback TCP: moondb and libzmq alone, in turn.
std::vector<BenchCase> RemoteCases();
// Cost of a system that has nothing to do.
std::vector<BenchCase> IdleCases();

}  // namespace moondb
