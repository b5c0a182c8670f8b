// The cases within one process: moondb, CAF (where this build has it) and the limit, in turn.
#pragma once

#include <string>
#include <vector>

#include "bench/measure.h"
#include "bench/options.h"

namespace moondb {

// In the order of the report.
std::vector<std::string> InProcessCases();

// `name` is one of InProcessCases.
Result<Section> RunInProcessCase(const std::string& name, const BenchOptions& options);

}  // namespace moondb
