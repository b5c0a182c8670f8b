// SimulatedDrive: where simulated rovers drive, and what their robots learn on the way: nodes, odometry with noise,
// ranges to each other and to the base station, and small maps of what lies around. Each drives in a circle of its own.
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

  // The agent's next node, the first one where it starts: the node, and the edges to it. A base station has one.
  std::vector<proto::Record> NextNode(AgentId agent);
  // What a rover sees around its last node.
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
