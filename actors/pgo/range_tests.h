// Outlier tests of ranges. Pure functions.
#pragma once

#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// Returns one flag for each of CheckedGraph::ranges, computed from the residuals in sigmas. A range is rejected beyond
// SolverOptions::reject_sigmas.
//
// An obstacle blocks a line of sight for a while. A range next to a rejected one of the same pair, with a residual of
// the same sign, is therefore rejected beyond burst_sigmas. The two may be at most three of the pair's usual intervals
// apart.
//
// `before`: verdicts of the last test. A rejected range returns only below 0.9 of the limit. A range that does not take
// part in the solve keeps its verdict.
std::vector<bool> FindInliers(const CheckedGraph& graph, const CostTerms& terms, const std::vector<double>& residuals,
                              const std::vector<bool>& before, const SolverOptions& options);

// Returns true if most ranges of an agent with at least four ranges are rejected. The agent is then more likely
// misplaced than all these ranges too long.
bool HasMostlyRejected(const CheckedGraph& graph, const std::vector<bool>& is_inlier);

// Range verdicts available at the start of a warm solve.
struct FirstVerdicts {
  // The last verdict. For a range with a new node: whether it fits the node's initial values.
  std::vector<bool> is_inlier;
  std::vector<bool> is_inlier_before;  // The last verdict; true for ranges with a new node.
  std::vector<bool> is_trusted;        // Accepted in the last solution.
  // True if more than 40 % of a rover's new ranges do not fit, or more than half of all its ranges are rejected. The
  // rover is then more likely misplaced than all these ranges too long.
  bool is_doubtful = false;
};

FirstVerdicts FindFirstVerdicts(const CheckedGraph& graph, const InitialValues& initial,
                                const std::vector<double>& residuals, const LastSolution& last,
                                const SolverOptions& options);

}  // namespace moondb
