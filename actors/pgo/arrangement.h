// Stage 0: where parts of a graph stand to each other when nothing but ranges joins them.
//
// Each part is a rigid body whose nodes stand to each other as their own steps say, so that a handful of unknowns is
// left; ranges have many local minima in them, so the bodies are set down in many ways (each on the circle of its first
// range about what stands already, turned evenly) and fitted. Full graphs from such starts end wrong mostly, and right
// mostly when the bodies were arranged before.
#pragma once

#include <functional>
#include <map>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

struct Arrangement {
  double cost = 0;  // Robust, for comparing only.
  PlainState state;
  std::map<std::size_t, Pose> map_from_body;  // By the body's head; bodies that no range joins are missing.
};

struct ArrangementOptions {
  BodyFreedom freedom = BodyFreedom::kSpatial;
  int starts = 40;       // With more than 20 bodies fewer, so that the time stays in bounds.
  std::size_t kept = 3;  // The best distinct arrangements.
  // Evenly chosen where there are more; a body that gets less than 10 of its own by that has 10 chosen evenly, too.
  std::size_t ranges_max = 400;
  bool begins_as_given = false;  // One more start: every body where `state` has it.
  // Polled at each start and iteration; true ends the search with what was found.
  std::function<bool()> stop_requested = {};
};

// `placed` nodes stand where `state` has them; the others form bodies (nodes of one of `heads`), each in a frame of its
// own in `state`. Gives the best arrangements, best first; at least one. Bodies that no range joins stay as they are.
// Deterministic: the starts are evenly spread, not drawn.
std::vector<Arrangement> ArrangeParts(const StandaloneGraph& graph, const ActiveNodes& active,
                                      const std::vector<bool>& placed, const std::vector<std::size_t>& heads,
                                      const PlainState& state, const ArrangementOptions& options);

}  // namespace moondb
