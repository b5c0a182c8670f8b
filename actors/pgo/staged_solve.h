// SolveInStages: minimises the cost from one set of initial values, alternating with outlier tests.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/outlier_tests.h"

namespace moondb {

struct StagedResult {
  bool is_accepted = false;  // True if all numbers are finite, Ceres converged, and the cost did not increase.
  std::string text;          // The reason if the solution was not accepted.
  State state;
  std::vector<bool> is_inlier;  // One flag per tested factor (graph_check.h).
  double initial_cost = 0;
  double final_cost = 0;
  int iterations = 0;
};

// Minimises with a Cauchy loss on the tested factors, then alternates least squares and outlier tests until a test
// gives the same verdicts as the previous test.
//
// `first`: verdicts that replace the Cauchy stage in a warm solve; nullopt in a cold solve. If first->is_doubtful, the
// Cauchy stage runs, but factors whose flag in first->is_trusted is true get no Cauchy loss. Factors whose flag in
// `is_allowed` is false are left out.
StagedResult SolveInStages(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
                           const std::vector<bool>& is_allowed, const SolverOptions& options);

// Continues from `from` without the factors whose flag in `is_allowed` is false: alternates least squares and outlier
// tests. The result's initial_cost is 0.
StagedResult ContinueInStages(const CostTerms& terms, const CheckedGraph& graph, const StagedResult& from,
                              const std::vector<bool>& is_allowed, const SolverOptions& options);

}  // namespace moondb
