// Chooses the frame `map` of a team in which nothing says where anybody is.
#pragma once

#include <optional>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/known_graph.h"
#include "model/pose_graph.h"

namespace moondb {

// Gives one rover a start if no rover with nodes has one, no node has a prior, and no base station with a position has
// ranges. This is the rover with the lowest id among those whose published poses are placed, at the published pose of
// its first node. If no pose is placed, it is the lowest id of all, at its raw pose. The frame thus stays where it is
// when the leader changes. Returns this rover; nullopt if the frame is known. `graph`: the graph to solve.
std::optional<AgentId> ChooseMapFrame(const PoseGraph& graph, const KnownGraph& known, AgentFactsMap& agents);

}  // namespace moondb
