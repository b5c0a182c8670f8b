#include "actors/pgo/staged_solve.h"

#include <cmath>
#include <utility>

namespace moondb {

namespace {

constexpr int kTestsMax = 10;  // Maximum number of range tests; two or three are usual.

// Returns true if `cost` exceeds `reference` by more than rounding errors explain. Both are sums of squares.
bool IsHigher(double cost, double reference) { return cost > reference * (1 + 1e-6) + 1e-9; }

}  // namespace

StagedResult SolveInStages(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
                           const SolverOptions& options) {
  StagedResult result;
  result.state = terms.initial();
  result.is_inlier.assign(graph.ranges.size(), true);
  StageResult stage;
  stage.has_converged = true;
  Stage next = terms.FirstStage(Loss::kNone);
  if (first && !first->is_doubtful) {
    result.is_inlier = first->is_inlier;
  } else if (!graph.ranges.empty()) {
    Stage robust = terms.FirstStage(Loss::kCauchyOnRanges);
    robust.is_rough = true;
    if (first) robust.is_trusted = first->is_trusted;
    stage = terms.Minimise(result.is_inlier, robust, result.state);
    result.iterations += stage.iterations;
    const std::vector<bool>& before = first ? first->is_inlier_before : result.is_inlier;
    result.is_inlier = FindInliers(graph, terms, terms.RangeResiduals(result.state), before, options);
    next.is_near = true;
  }
  for (int test = 0; stage.has_converged && test < kTestsMax; ++test) {
    stage = terms.Minimise(result.is_inlier, next, result.state);
    result.iterations += stage.iterations;
    next.is_near = true;
    std::vector<bool> is_inlier =
        FindInliers(graph, terms, terms.RangeResiduals(result.state), result.is_inlier, options);
    if (is_inlier == result.is_inlier) break;
    if (test + 1 < kTestsMax) result.is_inlier = std::move(is_inlier);
  }
  if (!stage.has_converged) {
    result.text = "did not converge: " + stage.text;
    return result;
  }
  result.initial_cost = terms.Cost(result.is_inlier, terms.initial());
  result.final_cost = terms.Cost(result.is_inlier, result.state);
  result.is_accepted = std::isfinite(result.final_cost) && !IsHigher(result.final_cost, result.initial_cost);
  if (!result.is_accepted) result.text = "the cost did not fall";
  return result;
}

}  // namespace moondb
