// Outlier tests of ranges. Pure functions.
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
// An obstacle blocks a line of sight for a while. A range next to a rejected one of the same pair, with a residual of
// the same sign, is therefore rejected beyond burst_sigmas. The two may be at most three of the pair's usual intervals
// apart.
//
// `before`: verdicts of the last test. A rejected range is accepted again only below 0.9 of the limit. A range that
// does not take part in the solve keeps its verdict.
std::vector<bool> FindInliers(const CheckedGraph& graph, const CostTerms& terms, const std::vector<double>& residuals,
                              const std::vector<bool>& before, const SolverOptions& options);

// Returns true if, for any agent with at least four ranges, most of these ranges are rejected. It is then more likely
// that the agent is misplaced than that all these ranges are too long.
bool HasMostlyRejected(const CheckedGraph& graph, const std::vector<bool>& is_inlier);

// The verdicts with which a warm solve starts. Each list has one flag per range.
struct FirstVerdicts {
  // The last verdict. For a range of a new node: true if the range fits the node's initial values.
  std::vector<bool> is_inlier;
  std::vector<bool> is_inlier_before;  // The last verdict; true for a range of a new node.
  std::vector<bool> is_trusted;        // True if the range was accepted in the last solution.
  // True if more than 40 % of a rover's new ranges do not fit, or if more than half of all its ranges are rejected. It
  // is then more likely that the rover is misplaced than that all these ranges are too long.
  bool is_doubtful = false;
};

FirstVerdicts FindFirstVerdicts(const CheckedGraph& graph, const InitialValues& initial,
                                const std::vector<double>& residuals, const LastSolution& last,
                                const SolverOptions& options);

}  // namespace moondb
