// Third part of pgo_bench. Draws the odometry, ranges and start poses of a recorded mission again from the true poses,
// with the noise model of apps/moondb_mission/measurement.h. The spread over many draws shows how much the result of
// the recording depends on chance.
#pragma once

#include <map>
#include <string>

#include "bench/pgo_methods.h"
#include "bench/pgo_team.h"
#include "model/mission.h"

namespace moondb {

struct RedrawRun {
  std::string name;
  int draws = 0;
  std::map<Method, MethodFigures> methods;
  MethodFigures without_bursts;  // Least squares without the ranges of bursts: about the best possible result.
};

RedrawRun RunRedraws(const std::string& name, const Mission& mission, int draws, const SolverOptions& options);

}  // namespace moondb
