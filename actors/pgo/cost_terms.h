// CostTerms: the cost F of one pose graph (pose_graph_solver.h), and its minimisation with Ceres. Robust kernels
// (losses) apply only to the tested factors (graph_check.h): ranges, loop closures and priors.
//
// One object serves all stages of a solve. `graph` and `options` must outlive this object. Single-threaded, except for
// Ceres's own threads.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/problem.h>

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "actors/pgo/factors.h"
#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/linearization.h"
#include "actors/pgo/pose_graph_solver.h"

namespace moondb {

// The variables of a solve.
struct State {
  std::vector<PoseBlock> poses;  // In the order of CheckedGraph::nodes.
  std::vector<double> numbers;   // Odometry scales of the rovers, then range biases of the pairs of agents.
};

enum class Loss { kNone, kHuber, kCauchy };

// Settings of one minimisation within a solve.
struct Stage {
  Loss loss = Loss::kNone;
  // True if the initial values are close to the minimum. The trust region is then large at the start.
  bool is_near = false;
  // True if a loose tolerance suffices, because the result is used only to classify the tested factors.
  bool is_rough = false;
  std::vector<bool> is_trusted = {};  // True for tested factors to which `loss` is not applied. Empty: all false.
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

  // Minimises the cost over all terms except the tested factors whose flag in `is_used` is false. Updates `state` in
  // place. Tries Levenberg-Marquardt first, and dogleg if Levenberg-Marquardt does not converge.
  StageResult Minimise(const std::vector<bool>& is_used, const Stage& stage, State& state) const;

  // Returns the settings of a stage that starts from the initial values and runs to full tolerance.
  Stage FirstStage(Loss loss) const { return {.loss = loss, .is_near = is_warm_}; }

  // Returns the cost F at `state` without a robust loss function (Loss::kNone). Omits the tested factors whose flag in
  // `is_used` is false.
  double Cost(const std::vector<bool>& is_used, const State& state) const;

  // Returns the marginal covariance of each of `nodes`. Rows are the position in the frame `map`, then the rotation in
  // the node's own frame (the tangent of PoseManifold). Returns an empty list if the graph does not determine the
  // covariances. Requires: `nodes` are free, and `state` is a minimum over the tested factors in `is_used`.
  std::vector<Matrix6d> Covariances(const std::vector<bool>& is_used, const std::vector<std::size_t>& nodes,
                                    const State& state) const;

  // Returns the terms linearised at `state`, without a loss. The columns are six for each free node (PoseManifold), in
  // the order of CheckedGraph::nodes, then one for each number that is not held.
  LinearTerms Linearise(const std::vector<bool>& is_used, State state) const;
  // Returns `state` after a move of the columns of Linearise.
  State Move(const State& state, const Eigen::VectorXd& move) const;

  // Returns F over all terms, with the Cauchy loss on tested factors. Omits the tested factors whose flag in
  // `is_allowed` is false. Used to compare solutions that accept different factors.
  double RobustCost(const std::vector<bool>& is_allowed, const State& state) const;

  // Returns RobustCost by agent: tested factors by their producer, other terms by the agent of their node. Omits scales
  // and biases.
  std::map<AgentId, double> RobustCosts(const std::vector<bool>& is_counted, const State& state) const;

  // Returns the residual of each tested factor in sigmas: signed for a range, the Mahalanobis distance for a loop
  // closure or prior, 0 for factors that are not part of this solve.
  std::vector<double> TestedResiduals(const State& state) const;
  bool HasTested(std::size_t factor) const { return tested_terms_[factor] != kNoTerm; }

 private:
  static constexpr int kNone = -1;
  static constexpr std::size_t kNoTerm = static_cast<std::size_t>(-1);

  // A factor and the parameter blocks that it depends on.
  struct Term {
    std::unique_ptr<ceres::CostFunction> factor;
    int pose_a = kNone;
    int pose_b = kNone;
    int number = kNone;
    int tested = kNone;  // Number of the tested factor.
  };

  void AddOdometry(const std::vector<Rover>& rovers);
  void AddRanges(const AgentFactsMap& agents, const PairNumbers& biases_m);
  void AddClosuresAndPriors();
  void AddTested(Term term, bool is_moving);
  void AddStartsAndGravity(const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts);
  void AddNumber(double value, double sigma);
  bool HasColumn(std::size_t number) const { return !is_window_ && !held_numbers_.contains(number); }
  bool IsMoving(std::size_t a, std::size_t b) const { return is_free_[a] || is_free_[b]; }
  bool IsUsed(const Term& term, const std::vector<bool>& is_used) const;
  // Adds all blocks and terms to `problem`. `state`, `manifold` and `loss` must outlive `problem`.
  void Build(const std::vector<bool>& is_used, const std::vector<bool>& is_trusted, ceres::LossFunction* loss,
             PoseManifold& manifold, State& state, ceres::Problem& problem) const;
  void HoldStanding(State& state, ceres::Problem& problem) const;
  static std::vector<double*> BlocksOf(const Term& term, State& state);
  StageResult Try(const std::vector<bool>& is_used, const Stage& stage, bool is_dogleg, State& state) const;
  void AddTerms(const std::vector<bool>& is_used, const std::vector<bool>& is_trusted, ceres::LossFunction* loss,
                State& state, ceres::Problem& problem) const;

  const CheckedGraph& graph_;
  const SolverOptions& options_;
  bool is_warm_;
  std::vector<bool> is_free_;
  bool is_window_;  // True if SolverOptions::window_nodes is not 0. Scales and biases are then held constant.
  std::set<std::size_t> held_numbers_;  // Indices in State::numbers of the scales that are fixed.
  State initial_;
  std::vector<Term> terms_;
  std::vector<std::size_t> tested_terms_;  // Index in terms_ of each tested factor; kNoTerm if omitted.
};

}  // namespace moondb
