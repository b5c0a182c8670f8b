// Prints the results of pgo_bench.
#pragma once

#include <string>
#include <vector>

#include "bench/pgo_closures.h"
#include "bench/pgo_graphs.h"
#include "bench/pgo_lies.h"
#include "bench/pgo_redraws.h"
#include "bench/pgo_registration.h"
#include "bench/pgo_team.h"

namespace moondb {

std::string TableOf(const std::vector<GraphRun>& graphs);
std::string TableOf(const std::vector<TeamRun>& teams);
std::string TableOf(const std::vector<RedrawRun>& redraws);
std::string TableOf(const std::vector<ClosureRun>& closures);
std::string TableOf(const std::vector<RegistrationRun>& registrations);
std::string TableOf(const std::vector<LieRun>& lies);
std::string TextOf(const UnknownStartsRun& run);

// Returns one JSON object. `graphs`: for each graph its name, cost, ate_m (null if the truth is unknown), seconds and
// initialisation, and the same numbers for least squares from odometry. `redraws` and `teams`: for each entry, the
// statistics of its methods. `closures`, `registrations` and `lies`: the fields of each ClosureRun, RegistrationRun and
// LieRun.
// `unknown_starts`: the counts of UnknownStartsRun.
std::string JsonOf(const std::vector<GraphRun>& graphs, const std::vector<RedrawRun>& redraws,
                   const std::vector<ClosureRun>& closures, const std::vector<RegistrationRun>& registrations,
                   const std::vector<LieRun>& lies, const std::vector<TeamRun>& teams, const UnknownStartsRun& unknown);

}  // namespace moondb
