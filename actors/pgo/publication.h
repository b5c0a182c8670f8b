// Converts a solution to records (poses that moved, verdicts that changed) and to the reply that the requester gets.
#pragma once

#include <cstdint>
#include <vector>

#include "actors/pgo/known_graph.h"
#include "actors/pgo/pose_graph_solver.h"
#include "proto/graph.pb.h"
#include "proto/record.pb.h"

namespace moondb {

struct PublicationOptions {
  // A pose that moved by less than both thresholds since its last publication is not published, to save radio time.
  double move_threshold_m = 0.01;
  double move_threshold_rad = 0.002;
};

struct Publication {
  std::vector<proto::Record> records;  // Optimized poses, then verdicts, each sorted by key.
  std::size_t pose_count = 0;
};

// Returns the poses of rovers' nodes that were never published, moved beyond a threshold, or belong to a rover that is
// placed now and was not before, or the reverse. Also returns the verdicts that changed. Returns no records if the
// solution was not accepted.
Publication MakePublication(const Solution& solution, const KnownGraph& known, const AgentFactsMap& agents,
                            const PublicationOptions& options, const proto::Term& term, std::uint64_t run,
                            std::int64_t timestamp_ns);

// Returns the reply to the requester. Sets `error` to kInternal if the solution was not accepted, or to kNotFound if
// there was nothing to solve.
proto::OptimizeReply ToReply(const Solution& solution);

}  // namespace moondb
