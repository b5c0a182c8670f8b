// FindFarNodes: names the nodes that lie absurdly far from the rest of the team. Such a node has a wrong pose, for
// example because a record has a wrong unit.
//
// A node is far if its distance from the team's median position exceeds 10 km and also 10 times the longest trajectory
// of a rover. The median position of a team of three agents or more is the median of its agents' median positions, so
// one agent with many nodes does not move it. With fewer agents it is the median of all nodes. The length of a
// trajectory is the median distance between successive nodes times their number, so single wrong poses do not change
// it. If half of the nodes or more would be far, none is, because nothing says which half is right.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "model/ids.h"
#include "proto/ids.pb.h"

namespace moondb {

struct FarNode {
  NodeKey node;
  double distance_m = 0;  // Distance from the team's median position.
};

// Returns the far nodes, the farthest first. `positions_m`: position of each node in the frame `map`, sorted by node.
std::vector<FarNode> FindFarNodes(const std::vector<std::pair<NodeKey, Eigen::Vector3d>>& positions_m);

inline constexpr std::size_t kFarNodesShown = 16;

// Adds the first kFarNodesShown nodes to a message.
void AddFarNodes(const std::vector<FarNode>& far, google::protobuf::RepeatedPtrField<proto::FarNode>& nodes);

}  // namespace moondb
