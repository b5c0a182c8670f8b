// Initial poses of rovers without a configured start.
//
// Ranges to the rest of the team determine such a pose, but often ambiguously. A rover that measures ranges to one
// other agent from a straight line may be on either side of the line. This file therefore returns several sets of
// initial values, and the caller solves from each and compares the results. The ambiguity may remain after the first
// solve, until later ranges resolve it. Pure functions.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"

namespace moondb {

// Returns the indices in `rovers` of those that have no configured start and that ranges join to others.
std::vector<std::size_t> FindUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                           const std::vector<StartPrior>& starts);

// Returns the best arrangements of the unknown rovers (arrangement.h), best first, as initial values. Each unknown
// rover is an upright rigid body, because gravity determines its tilt. Suppose ranges join rovers to each other, but to
// nothing with a known place and yaw. The rover with the most ranges then stays where `initial` has it. A group joined
// only to a base station does so from the second solve on, because then its place is right except for the unknown yaw.
//
// If `initial` contains poses from an unknown rover's last solution, only different arrangements are returned, and only
// those that fit the ranges nearly as well as the current one or better. The result is empty while the current places
// are unambiguous.
std::vector<InitialValues> ArrangeUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                                const std::vector<StartPrior>& starts,
                                                const std::vector<std::size_t>& unknown, const AgentFactsMap& agents,
                                                const InitialValues& initial,
                                                const std::function<bool()>& stop_requested);

// Returns true if the last solution contains a node of the rover.
bool HasWarmNode(const Rover& rover, const InitialValues& initial);

}  // namespace moondb
