// KeepStill: no rover moves as a whole without cause.
//
// Data leave directions in which a rover, or a part of the team that ranges join, can move with its shape unchanged and
// at hardly any cost: about the base station where no start is known, along a start's uncertainty otherwise. A solve
// ends anywhere in such a valley, and each time would move every pose and every map in it by centimetres for nothing.
// So what moved as a whole (a turn about z and a shift) against the last solution by more than is worth publishing goes
// back, unless that costs more. Shapes are as solved. Pure functions.
#pragma once

#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/graph_check.h"

namespace moondb {

// `state` with parts of the team, then single rovers, moved back. `is_inlier`: accepted ranges, which join parts.
// The robust cost rises by less than SolverOptions::still_cost in all.
State KeepStill(const CheckedGraph& graph, const std::vector<Rover>& rovers, const CostTerms& terms,
                const std::vector<bool>& is_inlier, const LastSolution& last, const SolverOptions& options,
                State state);

}  // namespace moondb
