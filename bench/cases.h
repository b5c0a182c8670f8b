// The cases of runtime_bench. The option --only selects cases by name.
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

// Returns a case that runs `contest` and yields one Section.
BenchCase AsCase(Contest contest);

// Returns all cases below, in the order in which to run them.
std::vector<BenchCase> AllCases();

// Cases that measure how much the resident memory grows while messages flow. Run these cases first: memory that other
// cases freed would be reused, and the growth would look too small.
std::vector<BenchCase> MemoryCases();
// Cases within one process. They compare moondb with CAF (if this build has it) and with plain C++ without an actor
// library.
std::vector<BenchCase> InProcessCases();
// Cases between two agents over loopback TCP. They compare moondb with bare libzmq.
std::vector<BenchCase> RemoteCases();
// Cases that measure the processor time and the wake-ups of idle agents.
std::vector<BenchCase> IdleCases();

}  // namespace moondb
