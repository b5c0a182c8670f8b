// How pgo_bench prints what it measured.
#pragma once

#include <string>
#include <vector>

#include "bench/pgo_graphs.h"
#include "bench/pgo_redraws.h"
#include "bench/pgo_team.h"

namespace moondb {

std::string TableOf(const std::vector<GraphRun>& graphs);
std::string TableOf(const std::vector<TeamRun>& teams);
std::string TableOf(const std::vector<RedrawRun>& redraws);
std::string TextOf(const UnknownStartsRun& run);

// One object: `graphs`, each with name, cost, ate_m (null where no truth is known), seconds, initialisation and the
// same of plain least squares from odometry; `redraws` and `teams`, each with its methods; `unknown_starts`.
std::string JsonOf(const std::vector<GraphRun>& graphs, const std::vector<RedrawRun>& redraws,
                   const std::vector<TeamRun>& teams, const UnknownStartsRun& unknown);

}  // namespace moondb
