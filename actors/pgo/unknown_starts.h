// Initial poses of rovers without a configured start. Ranges to other agents determine the initial pose of such a
// rover, but often ambiguously. For example, a rover that measures ranges to one other agent from a straight line may
// be on either side of the line. This file therefore returns several sets of initial values. The caller solves from
// each set and compares the results.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"

namespace moondb {

// Returns the rovers that have no configured start and have ranges to other agents, as indices in `rovers`.
std::vector<std::size_t> FindUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                           const std::vector<StartPrior>& starts);

// Returns sets of initial values in which the rovers of `unknown` (result of FindUnknownRovers) are arranged by their
// ranges (arrangement.h), best first. Each of these rovers is an upright rigid body, because gravity determines its
// roll and pitch. If ranges join these rovers only to each other, or (from the second solve on) to a single base
// station, the rover with the most ranges keeps its place in `initial`.
//
// If the last solution contains one of these rovers, returns only arrangements that differ from the places in `initial`
// and fit the ranges nearly as well or better. The result is then empty if the places are unambiguous.
std::vector<InitialValues> ArrangeUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                                const std::vector<StartPrior>& starts,
                                                const std::vector<std::size_t>& unknown, const AgentFactsMap& agents,
                                                const InitialValues& initial,
                                                const std::function<bool()>& stop_requested);

// Returns true if the last solution contains a node of the rover.
bool HasWarmNode(const Rover& rover, const InitialValues& initial);

}  // namespace moondb
