// Initial poses of a StandaloneGraph from its odometry steps and landmark sightings. Ranges are not used.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

// Returns the head of each node: the lowest index of an active node connected to the node by steps and sightings
// between active nodes. An inactive node is its own head.
std::vector<std::size_t> FindHeads(const StandaloneGraph& graph, const ActiveNodes& active);

// Returns true if steps and sightings between active nodes close at least one loop. `heads`: result of FindHeads.
bool HasLoops(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads);

// Edges used to compose poses. kAll: all steps and sightings. kWay: only the steps from a node to the same agent's next
// node.
enum class ComposeAlong { kAll, kWay };

// Computes poses of active nodes that are not `placed`, by composing edges outwards from placed nodes, breadth first.
// Sets the flags of these nodes in `placed`. Nodes that cannot be reached from a placed node remain unplaced.
void ComposeFromPlaced(const StandaloneGraph& graph, const ActiveNodes& active, ComposeAlong along,
                       std::vector<bool>& placed, PlainState& state);

// Returns the node poses of each part relative to the part's head, which lies at the origin. A part is a set of nodes
// with the same head.
//
// Uses chordal relaxation: without ranges, and with arbitrary matrices in place of rotation matrices, the cost F
// (standalone_graph.h) is quadratic. Each matrix of the quadratic minimum is projected onto the nearest rotation. The
// result is usually close to the minimum of F (Carlone et al., ICRA 2015). If the graph has no loops or the relaxation
// has no unique minimum, composes the poses from odometry instead.
PlainState ChordalParts(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads);

}  // namespace moondb
