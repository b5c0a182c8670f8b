// What a StandaloneGraph leaves open: parts that nothing joins, and shapes that differ. Pure functions.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

// The smallest node that steps, sightings and ranges join each node with, directly or over others.
std::vector<std::size_t> FindJoined(const StandaloneGraph& graph);

// Parts whose place to each other is not known; all with a fixed node count as one.
std::size_t CountLooseParts(const StandaloneGraph& graph, const std::vector<std::size_t>& joined);

// Whether every part has one shape in both, wherever it stands: no place differs by more than 1 % of the part's extent
// once they lie on each other. A mirrored shape is another one.
bool HaveSameShape(const StandaloneGraph& graph, const std::vector<std::size_t>& joined, const PlainState& a,
                   const PlainState& b);

}  // namespace moondb
