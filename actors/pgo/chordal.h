// First guesses of a StandaloneGraph's poses from its steps and sightings, ranges aside.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

// The smallest active node that active steps and sightings join each node with; an inactive node is its own.
std::vector<std::size_t> FindHeads(const StandaloneGraph& graph, const ActiveNodes& active);

// Whether steps and sightings close loops, so that composing them one after the other wastes what they know.
bool HasLoops(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads);

// kWay: steps from a node to the agent's next one alone.
enum class ComposeAlong { kAll, kWay };

// Fills active nodes that are not `placed` from placed ones, step by step in order of distance; what nothing placed
// leads to stays unplaced.
void ComposeFromPlaced(const StandaloneGraph& graph, const ActiveNodes& active, ComposeAlong along,
                       std::vector<bool>& placed, PlainState& state);

// Each part (nodes of one head) in a frame of its own, its head at the origin. Chordal relaxation: F without ranges, in
// which rotation matrices may be any matrices, is quadratic; its minimum, with each matrix turned into the nearest
// rotation, lies near F's own in practice, where composed odometry may not (Carlone et al., ICRA 2015). Without loops
// this is composed odometry. Also composed where the relaxation has no unique minimum.
PlainState ChordalParts(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads);

}  // namespace moondb
