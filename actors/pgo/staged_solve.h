// SolveInStages: one beginning, taken to its minimum over the ranges that it believes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/range_tests.h"

namespace moondb {

struct StagedResult {
  bool is_accepted = false;  // Finite, converged, and no higher than where it began.
  std::string text;          // Why not.
  State state;
  std::vector<bool> is_inlier;  // Of CheckedGraph::ranges.
  double initial_cost = 0;
  double final_cost = 0;
  int iterations = 0;
};

// Ranges under a Cauchy loss, then least squares and tests of the ranges in turn until the tests say the same as
// before. `first`: where the solve goes on from one before. Its verdicts take the place of the robust stage; where they
// are in doubt, they hold in it for the ranges that were accepted before.
StagedResult SolveInStages(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
                           const SolverOptions& options);

}  // namespace moondb
