// SimulatedDrive: moves each simulated rover along its own circle, and returns its records: nodes, noisy odometry,
// ranges to other agents, and small maps of the surroundings.
#pragma once

#include <map>
#include <vector>

#include "apps/moondb_sim/simulated_world.h"
#include "model/geometry.h"
#include "proto/record.pb.h"

namespace moondb::simulation {

class SimulatedDrive {
 public:
  explicit SimulatedDrive(SimulatedWorld& world) : world_(world) {}

  // Moves the agent to its next node. Returns this node and its edges to earlier nodes. The first call returns the node
  // at the agent's start. Call only once for a base station.
  std::vector<proto::Record> NextNode(AgentId agent);
  // Returns a map of the rover's surroundings at its last node.
  proto::Record MapHere(AgentId rover);

 private:
  struct Way {
    std::uint64_t nodes = 0;
    Pose truth;
    Pose raw;
  };

  proto::Record Step(AgentId rover, Way& way);
  proto::Record Range(AgentId from, AgentId to);
  NodeKey LastNode(AgentId agent) const { return {agent, ways_.at(agent).nodes - 1}; }
  double Noise(double width) { return width * (2 * world_.Draw() - 1); }

  SimulatedWorld& world_;
  std::map<AgentId, Way> ways_;
};

}  // namespace moondb::simulation
