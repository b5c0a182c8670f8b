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

// Returns a case that runs a contest whose result is one number.
BenchCase AsCase(Contest contest);

// Returns all cases below, in the order in which to run them.
std::vector<BenchCase> AllCases();

// Cases that measure how much the resident memory grows while messages flow. Run them before all others: otherwise they
// could reuse memory that other cases have freed.
std::vector<BenchCase> MemoryCases();
// Cases within one process. They measure moondb, CAF (if this build has it) and the limit of the machine, in turn.
std::vector<BenchCase> InProcessCases();
// Cases between two agents over loopback TCP. They measure moondb and bare libzmq, in turn.
std::vector<BenchCase> RemoteCases();
// Cases that measure the cost of a system that has nothing to do.
std::vector<BenchCase> IdleCases();

}  // namespace moondb
