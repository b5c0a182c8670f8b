// Outlier tests of ranges.
#pragma once

#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// Returns one flag for each of CheckedGraph::ranges: true if the range is accepted. A range is rejected if its residual
// exceeds SolverOptions::reject_sigmas.
//
// An obstacle makes several consecutive ranges too long. The limit is therefore only burst_sigmas for a range next to a
// rejected range of the same pair, if both residuals have the same sign. The time between the two ranges must be at
// most three times the pair's median interval.
//
// `before`: verdicts of the last test. A rejected range is accepted again only below 0.9 of the limit. A range that
// does not take part in the solve keeps its verdict.
std::vector<bool> FindInliers(const CheckedGraph& graph, const CostTerms& terms, const std::vector<double>& residuals,
                              const std::vector<bool>& before, const SolverOptions& options);

// Returns true if, for any agent with at least four ranges, more than half of these ranges are rejected. The agent is
// then probably misplaced.
bool HasMostlyRejected(const CheckedGraph& graph, const std::vector<bool>& is_inlier);

// The verdicts with which a warm solve starts. Each list has one flag per range.
struct FirstVerdicts {
  // The last verdict. For a range of a new node: true if the range fits the node's initial values.
  std::vector<bool> is_inlier;
  std::vector<bool> is_inlier_before;  // The last verdict; true for a range of a new node.
  std::vector<bool> is_trusted;        // True if the range was accepted in the last solution.
  // True if more than 40 % of the ranges of a rover's new nodes do not fit, or if more than half of all its ranges are
  // rejected. The rover is then probably misplaced.
  bool is_doubtful = false;
};

FirstVerdicts FindFirstVerdicts(const CheckedGraph& graph, const InitialValues& initial,
                                const std::vector<double>& residuals, const LastSolution& last,
                                const SolverOptions& options);

}  // namespace moondb
