// Stage 0: finds the relative poses of parts of a graph that only ranges join.
//
// Each part is a rigid body whose internal poses follow from its own odometry, so only a handful of unknowns remain.
// Ranges give this small problem many local minima. The search therefore places the bodies in many ways and fits each
// placement. A body's first range to an already placed body gives a circle: the search puts the body on this circle in
// evenly spread orientations. Without this arrangement, solves of full graphs mostly end in a wrong minimum; with it,
// mostly in the right minimum.
#pragma once

#include <functional>
#include <map>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

struct Arrangement {
  double cost = 0;  // Robust cost; only for comparing arrangements.
  PlainState state;
  // Keyed by the body's head. A body that no range joins to others has no entry.
  std::map<std::size_t, Pose> map_from_body;
};

struct ArrangementOptions {
  BodyFreedom freedom = BodyFreedom::kSpatial;
  int starts = 40;       // Number of starts. Reduced for more than 20 bodies, to bound the time.
  std::size_t kept = 3;  // Number of best distinct arrangements to return.
  // Maximum number of ranges used, spread evenly over time. For a body that would get fewer than 10 of them, 10 evenly
  // spread ranges are used in addition, or all of its ranges if it has fewer.
  std::size_t ranges_max = 400;
  bool begins_as_given = false;  // If true, one more start leaves every body at its pose in `state`.
  // Polled at each start and each iteration. If it returns true, the search ends with the arrangements found so far.
  std::function<bool()> stop_requested = {};
};

// Returns the best arrangements, best first; at least one. `placed` nodes keep their poses in `state`. The other nodes
// form rigid bodies: a body is all nodes with the same head in `heads`, and `state` holds their poses relative to a
// frame of the body. Bodies that no range joins keep their poses. Deterministic: the starts are evenly spread, not
// random.
std::vector<Arrangement> ArrangeParts(const StandaloneGraph& graph, const ActiveNodes& active,
                                      const std::vector<bool>& placed, const std::vector<std::size_t>& heads,
                                      const PlainState& state, const ArrangementOptions& options);

}  // namespace moondb
