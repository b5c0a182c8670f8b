#include "actors/pgo/staged_solve.h"

#include <cmath>
#include <utility>

namespace moondb {

namespace {

constexpr int kTestsMax = 10;  // Maximum number of outlier tests; two or three are usual.

std::vector<bool> And(std::vector<bool> a, const std::vector<bool>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) a[i] = a[i] && b[i];
  return a;
}

// Returns true if `cost` exceeds `reference` by more than rounding errors explain. Both are sums of squares.
bool IsHigher(double cost, double reference) { return cost > reference * (1 + 1e-6) + 1e-9; }

// Alternates least squares and outlier tests until the verdicts no longer change. Updates `result`. Returns the last
// stage.
StageResult Alternate(const CostTerms& terms, const CheckedGraph& graph, Stage next,
                      const std::vector<bool>& is_allowed, const SolverOptions& options, StagedResult& result) {
  StageResult stage;
  stage.has_converged = true;
  for (int test = 0; stage.has_converged && test < kTestsMax; ++test) {
    stage = terms.Minimise(result.is_inlier, next, result.state);
    result.iterations += stage.iterations;
    next.is_near = true;
    std::vector<bool> is_inlier =
        FindInliers(graph, terms, terms.TestedResiduals(result.state), result.is_inlier, is_allowed, options);
    if (is_inlier == result.is_inlier) break;
    if (test + 1 < kTestsMax) result.is_inlier = std::move(is_inlier);
  }
  return stage;
}

}  // namespace

StagedResult SolveInStages(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
                           const std::vector<bool>& is_allowed, const SolverOptions& options) {
  StagedResult result;
  result.state = terms.initial();
  result.is_inlier = is_allowed;
  StageResult stage;
  stage.has_converged = true;
  Stage next = terms.FirstStage(Loss::kNone);
  if (first && !first->is_doubtful) {
    result.is_inlier = And(first->is_inlier, is_allowed);
  } else if (graph.tested_count() > 0) {
    Stage robust = terms.FirstStage(Loss::kCauchy);
    robust.is_rough = true;
    if (first) robust.is_trusted = first->is_trusted;
    stage = terms.Minimise(result.is_inlier, robust, result.state);
    result.iterations += stage.iterations;
    const std::vector<bool>& before = first ? first->is_inlier_before : result.is_inlier;
    result.is_inlier = FindInliers(graph, terms, terms.TestedResiduals(result.state), before, is_allowed, options);
    next.is_near = true;
  }
  if (stage.has_converged) stage = Alternate(terms, graph, next, is_allowed, options, result);
  if (!stage.has_converged) {
    result.text = "did not converge: " + stage.text;
    return result;
  }
  result.initial_cost = terms.Cost(result.is_inlier, terms.initial());
  result.final_cost = terms.Cost(result.is_inlier, result.state);
  result.is_accepted = std::isfinite(result.final_cost) && !IsHigher(result.final_cost, result.initial_cost);
  if (!result.is_accepted) result.text = "the cost did not decrease";
  return result;
}

StagedResult ContinueInStages(const CostTerms& terms, const CheckedGraph& graph, const StagedResult& from,
                              const std::vector<bool>& is_allowed, const SolverOptions& options) {
  StagedResult result;
  result.state = from.state;
  result.is_inlier = And(from.is_inlier, is_allowed);
  Stage next = terms.FirstStage(Loss::kNone);
  next.is_near = true;
  const StageResult stage = Alternate(terms, graph, next, is_allowed, options, result);
  result.text = stage.text;
  result.final_cost = terms.Cost(result.is_inlier, result.state);
  result.is_accepted = stage.has_converged && std::isfinite(result.final_cost);
  return result;
}

}  // namespace moondb
