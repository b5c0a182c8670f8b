// CostTerms: the cost function of one pose graph, and its minimisation by Ceres with some ranges left out.
//
// One object serves all stages of a solve: factors are made once, a State holds the numbers they act on.
// Single-threaded apart from Ceres' own threads.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/problem.h>

#include <memory>
#include <string>
#include <vector>

#include "actors/pgo/factors.h"
#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// What a solve changes.
struct State {
  std::vector<PoseBlock> poses;  // Of CheckedGraph::nodes.
  std::vector<double> numbers;   // Scales of the rovers, then biases of the pairs.
};

enum class Loss { kNone, kHuberOnRanges, kCauchyOnRanges };

// How one of the minimisations of a solve is done.
struct Stage {
  Loss loss = Loss::kNone;
  bool is_near = false;               // Begins near the minimum, so that it may step boldly.
  bool is_rough = false;              // Need not end exactly at the minimum: only the ranges are judged by it.
  std::vector<bool> is_trusted = {};  // Ranges that the loss spares; empty: none.
};

struct StageResult {
  bool has_converged = false;
  int iterations = 0;
  std::string text;  // Why not.
};

class CostTerms {
 public:
  // Only nodes in `is_free` move; terms between others are not there.
  CostTerms(const CheckedGraph& graph, const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts,
            const AgentFactsMap& agents, const InitialValues& initial, const std::vector<bool>& is_free,
            const SolverOptions& options);

  const State& initial() const { return initial_; }

  // Minimises from `state`, in place, over all terms but the ranges whose place in `uses_range` is false.
  // A first try with Levenberg-Marquardt, a second with dogleg.
  StageResult Minimise(const std::vector<bool>& uses_range, const Stage& stage, State& state) const;

  // A solve from the initial values, to the end.
  Stage FirstStage(Loss loss) const { return {.loss = loss, .is_near = is_warm_}; }

  // F without any loss, over the same terms.
  double Cost(const std::vector<bool>& uses_range, const State& state) const;

  // Marginal covariance of each of `nodes` at a minimum over the ranges in `uses_range`: of its position in the frame
  // `map`, then of its turn in its own frame (the tangent of PoseManifold). Empty where the graph does not determine
  // them. `nodes` are free.
  std::vector<Matrix6d> Covariances(const std::vector<bool>& uses_range, const std::vector<std::size_t>& nodes,
                                    State state) const;

  // F over all terms with the Cauchy loss on ranges: compares solutions that accept different ranges.
  double RobustCost(const State& state) const;

  // The residual of each range, in sigmas; 0 for one that has no part in this solve.
  std::vector<double> RangeResiduals(const State& state) const;
  bool HasRange(std::size_t range) const { return range_terms_[range] != kNoTerm; }

 private:
  static constexpr int kNone = -1;
  static constexpr std::size_t kNoTerm = static_cast<std::size_t>(-1);

  // One factor and the blocks that it acts on.
  struct Term {
    std::unique_ptr<ceres::CostFunction> factor;
    int pose_a = kNone;
    int pose_b = kNone;
    int number = kNone;
    int range = kNone;  // Its place in CheckedGraph::ranges.
  };

  void AddOdometry(const std::vector<Rover>& rovers);
  void AddRanges(const AgentFactsMap& agents, const PairNumbers& biases_m);
  void AddPriors(const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts);
  void AddNumber(double value, double sigma);
  bool IsMoving(std::size_t a, std::size_t b) const { return is_free_[a] || is_free_[b]; }
  bool IsUsed(const Term& term, const std::vector<bool>& uses_range) const;
  // All blocks and terms; `state`, `manifold` and `loss` must outlive `problem`.
  void Build(const std::vector<bool>& uses_range, const std::vector<bool>& is_trusted, ceres::LossFunction* loss,
             PoseManifold& manifold, State& state, ceres::Problem& problem) const;
  void HoldStanding(State& state, ceres::Problem& problem) const;
  static std::vector<double*> BlocksOf(const Term& term, State& state);
  StageResult Try(const std::vector<bool>& uses_range, const Stage& stage, bool is_dogleg, State& state) const;
  void AddTerms(const std::vector<bool>& uses_range, const std::vector<bool>& is_trusted,
                ceres::LossFunction* range_loss, State& state, ceres::Problem& problem) const;

  const CheckedGraph& graph_;
  const SolverOptions& options_;
  bool is_warm_;
  std::vector<bool> is_free_;
  bool is_window_;  // Numbers stand.
  State initial_;
  std::vector<Term> terms_;
  std::vector<std::size_t> range_terms_;  // Positions in terms_, in the order of CheckedGraph::ranges.
};

}  // namespace moondb
