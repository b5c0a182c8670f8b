// Initial poses of unknown rovers: rovers without a configured start. Ranges to other agents determine the initial pose
// of such a rover, but often ambiguously. For example, a rover that measures ranges to one other agent from a straight
// line may be on either side of the line. This file therefore returns several sets of initial values. The caller solves
// from each set and compares the results.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"

namespace moondb {

// Returns the unknown rovers that ranges join to others, as indices in `rovers`.
std::vector<std::size_t> FindUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                           const std::vector<StartPrior>& starts);

// Returns the best arrangements of the unknown rovers (arrangement.h), best first, as initial values. Each unknown
// rover is an upright rigid body, because gravity determines its roll and pitch. If ranges join unknown rovers only to
// each other, or (from the second solve on) to a single base station, the rover with the most ranges keeps its place in
// `initial`.
//
// If `initial` contains poses from an unknown rover's last solution, returns only arrangements that differ from the
// current places and fit the ranges nearly as well or better. The result is then empty if the current places are
// unambiguous.
std::vector<InitialValues> ArrangeUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                                const std::vector<StartPrior>& starts,
                                                const std::vector<std::size_t>& unknown, const AgentFactsMap& agents,
                                                const InitialValues& initial,
                                                const std::function<bool()>& stop_requested);

// Returns true if the last solution contains a node of the rover.
bool HasWarmNode(const Rover& rover, const InitialValues& initial);

}  // namespace moondb
