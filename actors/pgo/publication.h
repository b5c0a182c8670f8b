// What a solve gives the team: records of the poses that moved and the ranges it judged anew, and the answer to who
// asked. Pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "actors/pgo/known_graph.h"
#include "actors/pgo/pose_graph_solver.h"
#include "proto/graph.pb.h"
#include "proto/record.pb.h"

namespace moondb {

struct PublicationOptions {
  double move_threshold_m = 0.01;  // A pose that moved less than both is not worth a radio's time.
  double move_threshold_rad = 0.002;
};

struct Publication {
  std::vector<proto::Record> records;  // Optimized poses, then verdicts, each in order of their keys.
  std::size_t pose_count = 0;
};

// Poses of rovers' nodes that moved beyond the threshold against the published one, or have none yet; verdicts of
// ranges whose verdict changed. Empty where the solution was not accepted.
Publication MakePublication(const Solution& solution, const KnownGraph& known, const AgentFactsMap& agents,
                            const PublicationOptions& options, const proto::Term& term, std::uint64_t run,
                            std::int64_t timestamp_ns);

// `error` is kInternal where the solution was not accepted, kNotFound where there was nothing to solve.
proto::OptimizeReply ToReply(const Solution& solution);

}  // namespace moondb
