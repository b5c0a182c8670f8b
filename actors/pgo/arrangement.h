// ArrangeParts (stage 0 of a solve): finds initial poses of the parts of a graph that only ranges join.
//
// Each part is treated as a rigid body, so only a few unknowns remain. Ranges give this problem many local minima. The
// search therefore starts from many evenly spread poses of the bodies, and minimises the range errors from each start.
// Without this arrangement, solves of full graphs mostly end in a wrong minimum.
#pragma once

#include <functional>
#include <map>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

struct Arrangement {
  double cost = 0;  // Robust cost of the range errors.
  PlainState state;
  // Pose of each body, keyed by the body's entry in `heads` (argument of ArrangeParts). Bodies that no ranges join to a
  // placed node are absent.
  std::map<std::size_t, Pose> map_from_body;
};

struct ArrangementOptions {
  BodyFreedom freedom = BodyFreedom::kSpatial;
  int starts = 40;       // Number of starts. Reduced for more than 20 bodies, to bound the time.
  std::size_t kept = 3;  // Maximum number of distinct arrangements to return.
  // Maximum number of ranges to use, spread evenly over time. A body that would have fewer than 10 of these ranges gets
  // up to 10 of its ranges in addition.
  std::size_t ranges_max = 400;
  // If true, the search also starts once from the poses in `state` (argument of ArrangeParts), without moving any body
  // first.
  bool begins_as_given = false;
  // Polled at each start and each iteration. If it returns true, the search ends with the arrangements found so far.
  std::function<bool()> stop_requested = {};
};

// Returns at least one arrangement, in ascending order of cost. Nodes in `placed` keep their poses in `state`. All
// other nodes form rigid bodies: nodes with the same entry in `heads` are one body, and `state` holds their poses in
// the frame of the body. Bodies that no ranges join to a placed node keep their poses. Deterministic: the starts are
// evenly spread, not random.
std::vector<Arrangement> ArrangeParts(const StandaloneGraph& graph, const ActiveNodes& active,
                                      const std::vector<bool>& placed, const std::vector<std::size_t>& heads,
                                      const PlainState& state, const ArrangementOptions& options);

}  // namespace moondb
