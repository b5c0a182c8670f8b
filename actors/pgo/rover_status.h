// What a solve determined of each rover, and what it could not.
#pragma once

#include <set>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// `scales`: s of each rover; `ambiguous`: rovers that would stand nearly as well elsewhere.
std::vector<RoverResult> JudgeRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                     const std::vector<StartPrior>& starts, const std::vector<RangeVerdict>& ranges,
                                     const std::vector<double>& scales, const std::set<AgentId>& ambiguous);

}  // namespace moondb
