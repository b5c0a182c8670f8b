// PlaceByPoses: initial poses of rovers without a configured start, from loop closures to placed rovers and from
// priors.
//
// Each rover is an upright rigid body with the shape of its initial poses, because gravity determines roll and pitch.
// Each loop closure to a placed rover, each prior with a yaw, and each position prior together with the farthest other
// one proposes a place for the body. A proposal agrees with another one if the two places differ by at most 3 sigmas,
// where sigma includes the odometry's uncertainty between the two nodes. The proposal with the most agreement is used.
//
// A single loop closure places no rover, because it may be wrong: two with different nodes must agree. A prior with a
// yaw suffices alone. Rovers are placed one after the other, the one with the most agreement first. If no rover of the
// team is placed, the rover with the most loop closures keeps its initial poses, and the others are placed around it.
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"

namespace moondb {

struct PosePlacement {
  InitialValues initial;  // The given initial values, with the placed rovers moved.
  std::set<AgentId> placed;
  // Rovers with loop closures or priors that were not placed, and the reason.
  std::map<AgentId, std::string> not_placed;
};

// Returns the rovers that have no configured start and have loop closures to other rovers or priors, as indices in
// `rovers`.
std::vector<std::size_t> FindRoversToPlace(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                           const std::vector<StartPrior>& starts);

// Places the rovers of `unknown` (result of FindRoversToPlace).
PosePlacement PlaceByPoses(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                           const std::vector<StartPrior>& starts, const std::vector<std::size_t>& unknown,
                           const InitialValues& initial);

}  // namespace moondb
