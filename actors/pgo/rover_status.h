// Summarises what a solve could and could not determine about each rover.
#pragma once

#include <set>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// Returns one result per rover, in the order of `rovers`. `scales`: odometry scale error s of each rover. `ambiguous`:
// rovers whose ranges would fit another place of the rover nearly as well.
std::vector<RoverResult> JudgeRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                     const std::vector<StartPrior>& starts, const std::vector<RangeVerdict>& ranges,
                                     const std::vector<double>& scales, const std::set<AgentId>& ambiguous);

}  // namespace moondb
