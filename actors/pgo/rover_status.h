// Summarises what a solve could and could not determine about each rover.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// Returns one result per rover, in the order of `rovers`. `verdicts`: those on all tested factors, in their order.
// `scales`: odometry scale error s of each rover. `ambiguous`: rovers whose ranges would fit another place of the rover
// nearly as well. `not_placed`: rovers that their loop closures or priors did not place, and the reason.
std::vector<RoverResult> JudgeRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                     const std::vector<StartPrior>& starts, const std::vector<FactorVerdict>& verdicts,
                                     const std::vector<double>& scales, const std::set<AgentId>& ambiguous,
                                     const std::map<AgentId, std::string>& not_placed);

// Returns the rovers that have no pose in the frame `map`: those that are unanchored or ambiguous, and those whose yaw
// is free while another rover is placed. If the yaw of all rovers is free, they share one frame, about the base
// station.
std::set<AgentId> FindUnplaced(const std::vector<RoverResult>& rovers);

}  // namespace moondb
