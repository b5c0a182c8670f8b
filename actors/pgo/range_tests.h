// Which ranges a solve believes. Pure functions.
#pragma once

#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// One for each of CheckedGraph::ranges, from its residual in sigmas: beyond SolverOptions::reject_sigmas it is
// rejected; next to a rejected one of the same pair that errs the same way beyond burst_sigmas already, since what
// blocks a line of sight does so for a while (three of the pair's usual intervals at most). `before`: what the last
// test said; a rejected range returns only below 0.9 of the limit, and one that has no part in the solve keeps what was
// said.
std::vector<bool> FindInliers(const CheckedGraph& graph, const CostTerms& terms, const std::vector<double>& residuals,
                              const std::vector<bool>& before, const SolverOptions& options);

// Whether an agent with at least four ranges has most of them rejected: it stands in the wrong place more often than
// they are all too long.
bool HasMostlyRejected(const CheckedGraph& graph, const std::vector<bool>& is_inlier);

// What a solve that goes on from one before may say of its ranges at once.
struct FirstVerdicts {
  std::vector<bool> is_inlier;  // The last verdicts; of ranges with a new node, whether they fit its first guess.
  std::vector<bool> is_inlier_before;  // The last verdicts; true of ranges with a new node.
  std::vector<bool> is_trusted;        // Accepted in the last solution.
  // More than four in ten of a rover's new ranges do not fit, or half of all its ranges are rejected: it is more
  // likely that the rover is elsewhere than that they are all too long.
  bool is_doubtful = false;
};

FirstVerdicts FindFirstVerdicts(const CheckedGraph& graph, const InitialValues& initial,
                                const std::vector<double>& residuals, const LastSolution& last,
                                const SolverOptions& options);

}  // namespace moondb
