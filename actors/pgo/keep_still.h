// KeepStill: fixes the gauge by removing rigid motions of a trajectory that the measurements do not determine.
//
// The data leave gauge freedom: directions in which a rover, or a part of the team joined by ranges, can move rigidly
// at almost no cost. Examples are a rotation about the base station if no start is known, and a shift within the
// uncertainty of a start. A solve ends anywhere along such a direction. Without KeepStill, each solve would move every
// pose, and every map that depends on the pose, by centimetres for no reason.
//
// KeepStill therefore undoes the rigid motion (a rotation about z and a translation) since the last solution, if the
// motion exceeds the publication threshold and undoing it costs almost nothing. Shapes remain as solved. Pure
// functions.
#pragma once

#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/graph_check.h"

namespace moondb {

// Returns `state` with its rigid motions undone, first of parts of the team, then of single rovers. `is_inlier`: flags
// of the accepted ranges, which join rovers to parts. The robust cost rises by less than SolverOptions::still_cost in
// total.
State KeepStill(const CheckedGraph& graph, const std::vector<Rover>& rovers, const CostTerms& terms,
                const std::vector<bool>& is_inlier, const LastSolution& last, const SolverOptions& options,
                State state);

}  // namespace moondb
