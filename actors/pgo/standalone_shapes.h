// Finds ambiguities of a StandaloneGraph's solution: parts that are not connected, and solutions of different shape.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

// Returns, for each node, the lowest node index in its connected part. Steps, sightings and ranges connect nodes.
std::vector<std::size_t> FindJoined(const StandaloneGraph& graph);

// Returns the number of parts whose poses relative to each other are unknown. All parts with a fixed node count as one
// part. `joined`: result of FindJoined.
std::size_t CountLooseParts(const StandaloneGraph& graph, const std::vector<std::size_t>& joined);

// Returns true if every part has the same shape in `a` and `b`. The part's pose may differ. Two shapes are the same if,
// after alignment, no position differs by more than 1 % of the part's extent. A mirrored shape counts as different.
bool HaveSameShape(const StandaloneGraph& graph, const std::vector<std::size_t>& joined, const PlainState& a,
                   const PlainState& b);

}  // namespace moondb
