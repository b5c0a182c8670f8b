// CostTerms: the cost F of one pose graph (pose_graph_solver.h), and its minimisation with Ceres. Robust kernels
// (losses) apply only to ranges.
//
// One object serves all stages of a solve. `graph` and `options` must outlive this object. Single-threaded, except for
// Ceres's own threads.
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

// The variables of a solve.
struct State {
  std::vector<PoseBlock> poses;  // In the order of CheckedGraph::nodes.
  std::vector<double> numbers;   // Odometry scales of the rovers, then range biases of the pairs of agents.
};

enum class Loss { kNone, kHuberOnRanges, kCauchyOnRanges };

// Settings of one minimisation within a solve.
struct Stage {
  Loss loss = Loss::kNone;
  // True if the initial values are close to the minimum. The trust region is then large at the start.
  bool is_near = false;
  // True if a loose tolerance suffices, because the result is used only to classify the ranges.
  bool is_rough = false;
  std::vector<bool> is_trusted = {};  // True for ranges to which `loss` is not applied. Empty: all false.
};

struct StageResult {
  bool has_converged = false;
  int iterations = 0;
  std::string text;  // Ceres's message if the stage has not converged.
};

class CostTerms {
 public:
  // Nodes whose flag in `is_free` is false are constant. Factors whose poses are all constant are omitted.
  CostTerms(const CheckedGraph& graph, const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts,
            const AgentFactsMap& agents, const InitialValues& initial, const std::vector<bool>& is_free,
            const SolverOptions& options);

  const State& initial() const { return initial_; }

  // Minimises the cost over all terms except the ranges whose flag in `uses_range` is false. Updates `state` in place.
  // Tries Levenberg-Marquardt first, and dogleg if Levenberg-Marquardt does not converge.
  StageResult Minimise(const std::vector<bool>& uses_range, const Stage& stage, State& state) const;

  // Returns the settings of a stage that starts from the initial values and runs to full tolerance.
  Stage FirstStage(Loss loss) const { return {.loss = loss, .is_near = is_warm_}; }

  // Returns the cost F at `state` without a robust loss function (Loss::kNone). Omits the ranges whose flag in
  // `uses_range` is false.
  double Cost(const std::vector<bool>& uses_range, const State& state) const;

  // Returns the marginal covariance of each of `nodes`. Rows are the position in the frame `map`, then the rotation in
  // the node's own frame (the tangent of PoseManifold). Returns an empty list if the graph does not determine the
  // covariances. Requires: `nodes` are free, and `state` is a minimum over the ranges in `uses_range`.
  std::vector<Matrix6d> Covariances(const std::vector<bool>& uses_range, const std::vector<std::size_t>& nodes,
                                    State state) const;

  // Returns F over all terms, with the Cauchy loss on ranges. Used to compare solutions that accept different ranges.
  double RobustCost(const State& state) const;

  // Returns the residual of each range in sigmas; 0 for ranges that are not part of this solve.
  std::vector<double> RangeResiduals(const State& state) const;
  bool HasRange(std::size_t range) const { return range_terms_[range] != kNoTerm; }

 private:
  static constexpr int kNone = -1;
  static constexpr std::size_t kNoTerm = static_cast<std::size_t>(-1);

  // A factor and the parameter blocks that it depends on.
  struct Term {
    std::unique_ptr<ceres::CostFunction> factor;
    int pose_a = kNone;
    int pose_b = kNone;
    int number = kNone;
    int range = kNone;  // Index of the range in CheckedGraph::ranges.
  };

  void AddOdometry(const std::vector<Rover>& rovers);
  void AddRanges(const AgentFactsMap& agents, const PairNumbers& biases_m);
  void AddPriors(const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts);
  void AddNumber(double value, double sigma);
  bool IsMoving(std::size_t a, std::size_t b) const { return is_free_[a] || is_free_[b]; }
  bool IsUsed(const Term& term, const std::vector<bool>& uses_range) const;
  // Adds all blocks and terms to `problem`. `state`, `manifold` and `loss` must outlive `problem`.
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
  bool is_window_;  // True if SolverOptions::window_nodes is not 0. Scales and biases are then held constant.
  State initial_;
  std::vector<Term> terms_;
  std::vector<std::size_t> range_terms_;  // Index in terms_ of each range; kNoTerm if omitted.
};

}  // namespace moondb
