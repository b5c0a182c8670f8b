// KeepStill: removes rigid motions between two solutions that the measurements do not determine (gauge freedom).
//
// A rover, or a part of the team joined by ranges, can often move rigidly at almost no cost. Examples are a rotation
// about the base station if no start is known, and a shift within the uncertainty of a start. Without KeepStill, each
// solve would move every pose, and every map that depends on the pose, by centimetres for no reason.
#pragma once

#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/graph_check.h"

namespace moondb {

// Returns `state` with rigid motions since `last` (a rotation about z and a translation) undone, first of parts of the
// team, then of single rovers. A motion is undone if it exceeds SolverOptions::still_move_m or still_move_rad, and if
// the robust cost of all ranges and of the accepted loop closures and priors then rises by less than still_cost in
// total. `is_inlier`: flags of the accepted factors, of which ranges and loop closures join rovers to parts.
State KeepStill(const CheckedGraph& graph, const std::vector<Rover>& rovers, const CostTerms& terms,
                const std::vector<bool>& is_inlier, const LastSolution& last, const SolverOptions& options,
                State state);

}  // namespace moondb
