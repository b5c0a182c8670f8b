// Reads the pose graph that an agent holds, with the newest optimized pose of each node beside it.
#pragma once

#include <map>

#include "client/client.h"
#include "model/pose_graph.h"

namespace moondb {

struct ReadGraph {
  PoseGraph graph;  // Raw poses; of two nodes with one key the smaller record key stands.
  std::map<NodeKey, Pose> optimized;

  // The optimized pose where there is one, else the raw one.
  const Pose& NewestPose(const GraphNode& node) const {
    const auto found = optimized.find(node.key);
    return found == optimized.end() ? node.map_from_node : found->second;
  }
};

// The errors of Client::ReadAll, and kCorrupt for a record that does not hold what its type says.
Result<ReadGraph> ReadGraphOf(Client& client);

}  // namespace moondb
