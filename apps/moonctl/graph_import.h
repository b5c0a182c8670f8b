// Turns a PyFG file into the records that each agent would have made itself.
//
// Vertices of such files are usually the truth, or somebody's solution. Of each rover only the first is taken; its
// further raw poses are composed from odometry, as the robot would have known them. Plain functions.
#pragma once

#include <map>
#include <vector>

#include "model/error.h"
#include "model/pyfg.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

struct GraphImport {
  std::map<AgentId, std::vector<proto::Record>> records;  // By the agent that is to insert them: nodes, then edges.
  std::size_t node_count = 0;
  std::size_t odometry_count = 0;
  std::size_t range_count = 0;
  // Sightings, landmarks that are no base station, with their ranges, poses of one rover as another saw it, and loop
  // closures: poses between two nodes of one rover that do not follow one another.
  std::size_t left_out_count = 0;
};

// kInvalid if a letter stands for no agent of the team, or a node cannot be reached from its rover's first one.
Result<GraphImport> PrepareImport(const proto::TeamConfig& team, const Pyfg& pyfg);

}  // namespace moondb
