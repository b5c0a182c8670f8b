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

// Returns true if steps and sightings close loops. Poses composed of steps along a tree ignore such loop closures.
bool HasLoops(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads);

// Edges used to compose poses. kAll: all steps and sightings. kWay: only the steps from a node to the same agent's next
// node.
enum class ComposeAlong { kAll, kWay };

// Computes poses of active nodes that are not `placed` by composing edges outwards from placed nodes, breadth first.
// Nodes that cannot be reached from a placed node remain unplaced.
void ComposeFromPlaced(const StandaloneGraph& graph, const ActiveNodes& active, ComposeAlong along,
                       std::vector<bool>& placed, PlainState& state);

// Returns the node poses of each part relative to the part's head, which lies at the origin. A part is a set of nodes
// with the same head.
//
// Uses chordal relaxation: without ranges, and with arbitrary matrices in place of rotation matrices, F is quadratic.
// Each matrix of the quadratic minimum is projected onto the nearest rotation. In practice the result lies close to the
// minimum of F, unlike composed odometry in many cases (Carlone et al., ICRA 2015). If the graph has no loops or the
// relaxation has no unique minimum, composes the poses from odometry instead.
PlainState ChordalParts(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads);

}  // namespace moondb
