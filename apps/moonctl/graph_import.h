// Turns a PyFG file into the records that each agent would have inserted itself.
//
// The source of loop closures and priors is kImportSource, because files name none.
//
// Vertices in such files are usually ground truth or a solution. The import uses only the first vertex of each rover,
// and composes the rover's other raw poses from odometry, as the rover itself would have done.
#pragma once

#include <map>
#include <vector>

#include "model/error.h"
#include "model/pyfg.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

inline constexpr char kImportSource[] = "file";

struct GraphCounts {
  std::size_t nodes = 0;
  std::size_t odometry = 0;
  std::size_t ranges = 0;
  // Relative poses between two rovers, or between nodes of one rover that are not consecutive.
  std::size_t closures = 0;
  std::size_t priors = 0;

  void Add(const proto::Record& record);
  std::size_t edges() const { return odometry + ranges + closures; }
  std::size_t total() const { return nodes + edges() + priors; }
};

struct GraphImport {
  // Records by the agent that inserts them. The nodes of an agent precede its edges.
  std::map<AgentId, std::vector<proto::Record>> records;
  GraphCounts counts;
  // Number of skipped items: sightings, landmarks other than the base station, and ranges to and priors of landmarks.
  std::size_t left_out_count = 0;
};

// Returns the records for the graph. Returns kInvalid if a letter of the file belongs to no agent of the team, or if a
// rover has two letters (A and a). Also returns kInvalid if the odometry does not lead from the first node of a rover
// to each of its other nodes.
Result<GraphImport> PrepareImport(const proto::TeamConfig& team, const Pyfg& pyfg);

}  // namespace moondb
