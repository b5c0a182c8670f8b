// Initial poses of a StandaloneGraph from its odometry steps and landmark sightings. Ranges are not used.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

// Returns, for each node, the smallest active node connected to it by active steps and sightings. An inactive node is
// its own head.
std::vector<std::size_t> FindHeads(const StandaloneGraph& graph, const ActiveNodes& active);

// Returns true if steps and sightings close loops. Composing steps along a tree would ignore the loop closures.
bool HasLoops(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads);

// kWay: uses only the steps from a node to the same agent's next node.
enum class ComposeAlong { kAll, kWay };

// Computes poses of active nodes that are not `placed` by composing edges outwards from placed nodes, breadth first.
// Nodes that cannot be reached from a placed node remain unplaced.
void ComposeFromPlaced(const StandaloneGraph& graph, const ActiveNodes& active, ComposeAlong along,
                       std::vector<bool>& placed, PlainState& state);

// Returns poses relative to each part's head, which lies at the origin. A part is a set of nodes with the same head.
//
// Uses chordal relaxation: without ranges, and with arbitrary matrices in place of rotation matrices, F is quadratic.
// Each matrix of its minimum is projected onto the nearest rotation. In practice the result lies close to the minimum
// of F, where composed odometry may not (Carlone et al., ICRA 2015). If the graph has no loops or the relaxation has no
// unique minimum, the poses are composed odometry.
PlainState ChordalParts(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads);

}  // namespace moondb
