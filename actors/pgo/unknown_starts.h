// Where rovers begin of whom nobody has told: neither a configured start nor a last solution.
//
// Ranges to the rest of the team say it, often in more than one way: a rover that ranges one other from a straight line
// may be on either side of it. So several beginnings are offered, and whoever solves from each compares the ends.
// Pure functions.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"

namespace moondb {

// Places in `rovers`; empty where all are known.
std::vector<std::size_t> FindUnknownRovers(const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts,
                                           const InitialValues& initial);

// Initial values with the unknown rovers set down by their ranges (arrangement.h), each as a body that stands upright,
// as gravity has it. First `initial` itself, since raw poses may hold a start that the configuration does not; then the
// best arrangements, best first.
std::vector<InitialValues> ArrangeUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                                const std::vector<std::size_t>& unknown, const AgentFactsMap& agents,
                                                const InitialValues& initial);

}  // namespace moondb
