// Outlier tests of ranges, loop closures and priors.
#pragma once

#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// Returns one flag for each tested factor: true if the factor is accepted. A range is rejected if its residual exceeds
// SolverOptions::reject_sigmas, and a loop closure or prior if its residual exceeds reject_distance.
//
// An obstacle makes several consecutive ranges too long. The limit is therefore only burst_sigmas for a range next to a
// rejected range of the same pair, if both residuals have the same sign. The time between the two ranges must be at
// most three times the pair's median interval.
//
// `before`: verdicts of the last test. A rejected factor is accepted again only below 0.9 of the limit. A factor that
// does not take part in the solve keeps its verdict. Factors whose flag in `is_allowed` is false are rejected.
std::vector<bool> FindInliers(const CheckedGraph& graph, const CostTerms& terms, const std::vector<double>& residuals,
                              const std::vector<bool>& before, const std::vector<bool>& is_allowed,
                              const SolverOptions& options);

// Returns true if, for any agent with at least four ranges, more than half of these ranges are rejected. The agent is
// then probably misplaced.
bool HasMostlyRejected(const CheckedGraph& graph, const std::vector<bool>& is_inlier);

// The verdicts with which a warm solve starts. Each list has one flag per tested factor. A range is new if one of its
// nodes is new. A loop closure or prior is new if the last solution has no verdict on it.
struct FirstVerdicts {
  std::vector<bool> is_inlier;         // The last verdict. For a new factor: true if it fits the initial values.
  std::vector<bool> is_inlier_before;  // The last verdict; true for a new factor.
  std::vector<bool> is_trusted;        // True if the factor was accepted in the last solution.
  // True if more than 40 % of the ranges of a rover's new nodes do not fit, or if more than half of all its ranges are
  // rejected: the rover is then probably misplaced. Also true if a new loop closure or prior does not fit: it may
  // correct the last solution.
  bool is_doubtful = false;
};

FirstVerdicts FindFirstVerdicts(const CheckedGraph& graph, const InitialValues& initial,
                                const std::vector<double>& residuals, const LastSolution& last,
                                const SolverOptions& options);

}  // namespace moondb
