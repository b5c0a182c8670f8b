// SolveInStages: minimises the cost from one set of initial values, alternating with outlier tests of the ranges.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/range_tests.h"

namespace moondb {

struct StagedResult {
  bool is_accepted = false;  // True if all numbers are finite, Ceres converged, and the cost did not increase.
  std::string text;          // The reason if the solution was not accepted.
  State state;
  std::vector<bool> is_inlier;  // In the order of CheckedGraph::ranges.
  double initial_cost = 0;
  double final_cost = 0;
  int iterations = 0;
};

// Minimises with a Cauchy loss on ranges, then alternates least squares and range tests until a test gives the same
// verdicts as the previous test.
//
// `first`: verdicts that replace the Cauchy stage in a warm solve; nullopt in a cold solve. If first->is_doubtful, the
// Cauchy stage runs, but ranges whose flag in first->is_trusted is true get no Cauchy loss.
StagedResult SolveInStages(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
                           const SolverOptions& options);

}  // namespace moondb
