// Third part of pgo_bench. Draws the odometry, ranges and start poses of a recorded mission again from the true poses,
// with the noise model of apps/moondb_mission/measurement.h. The spread over many draws shows how much the result of
// the recording depends on chance.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "bench/pgo_methods.h"
#include "bench/pgo_team.h"
#include "model/mission.h"

namespace moondb {

struct RedrawRun {
  std::string name;
  int draws = 0;
  std::map<Method, MethodFigures> methods;
  std::optional<MethodFigures> with_matches;  // The solver with matches of the local maps (bench/pgo_registration.h).
  // Highest error with matches of a draw, divided by the error of the same draw without matches.
  double worst_match_ratio = 0;
  MethodFigures without_bursts;  // Least squares without the ranges of bursts: about the best possible result.
};

// `has_matches`: true to solve with matches too.
RedrawRun RunRedraws(const std::string& name, const Mission& mission, int draws, bool has_matches,
                     const SolverOptions& options);

}  // namespace moondb
