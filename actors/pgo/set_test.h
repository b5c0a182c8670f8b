// SolveWithSetTest: like SolveInStages, and refuses sets of loop closures or priors that are wrong together.
//
// A set holds all loop closures of one source between two rovers (or within one rover), or all priors of one source on
// one rover. Wrong measurements of one producer often agree with each other, for example if all matches of a rover are
// shifted by the same offset. Outlier tests of single factors accept such a set. Ranges are independent of it:
//
// - A set is refused if more than 3 % of the ranges, and at least 3, are accepted without it and rejected with it.
// - A set with n accepted residuals is refused if it raises the chi-square of the other terms (odometry, ranges,
//   starts, other sets) by more than n + 3 sqrt(2 n). Correct factors raise it by n at most, on average. This test also
//   works without ranges.
//
// The set that exceeds its limits most is refused first, and then the others are tested again. The limits are 2 % and n
// for a set of which the outlier tests reject more than half, and for a set that the last solution refused.
//
// Measured with loop closures drawn from the true poses of two recorded missions: correct sets raise the chi-square by
// 0.1 n to 0.3 n. A set that is shifted by 0.7 m raises it by 1.3 n.
//
// Limits: a solve tests the 16 largest sets. A common shift within the uncertainty of the other measurements is not
// detected.
#pragma once

#include <optional>
#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/outlier_tests.h"
#include "actors/pgo/staged_solve.h"

namespace moondb {

// Returns the sets of a graph, sorted by kind, agents and source.
std::vector<FactorSet> FindFactorSets(const CheckedGraph& graph);

struct SetTested {
  StagedResult staged;
  std::vector<FactorSet> refused;
};

// Solves like SolveInStages and tests the sets. All factors of refused sets are rejected. A solve of a window
// (SolverOptions::window_nodes) tests no set, and refuses those that the last solution refused.
SetTested SolveWithSetTest(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
                           const std::vector<bool>& is_allowed, const LastSolution& last, const SolverOptions& options);

}  // namespace moondb
