// pgo_bench's third part: a recorded mission with its odometry, ranges and start poses drawn anew from the truth, by
// the noise model of apps/moondb_mission/measurement.h. One recording is one draw; this shows how much of a result is
// luck.
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
  MethodFigures without_bursts;  // The same model on the ranges that no burst made long: nobody can do much better.
};

RedrawRun RunRedraws(const std::string& name, const Mission& mission, int draws, const SolverOptions& options);

}  // namespace moondb
