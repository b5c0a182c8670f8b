#include "actors/pgo/cost_terms.h"

#include <ceres/crs_matrix.h>
#include <ceres/loss_function.h>
#include <ceres/solver.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "actors/pgo/ceres_options.h"
#include "actors/pgo/ground.h"

namespace moondb {

namespace {

constexpr double kRoughTolerance = 1e-4;

ceres::Solver::Options SolveOptions(const SolverOptions& options, const Stage& stage, bool is_dogleg) {
  ceres::Solver::Options result = LeastSquaresOptions(options.thread_count, options.iterations_max);
  result.initial_trust_region_radius = stage.is_near ? kBoldTrustRegion : kCarefulTrustRegion;
  if (stage.is_rough) result.function_tolerance = kRoughTolerance;
  if (is_dogleg) {
    result.trust_region_strategy_type = ceres::DOGLEG;
    result.initial_trust_region_radius = kCarefulTrustRegion;
  }
  return result;
}

std::unique_ptr<ceres::LossFunction> MakeLoss(Loss loss, const SolverOptions& options) {
  if (loss == Loss::kCauchy) return std::make_unique<ceres::CauchyLoss>(options.cauchy_sigmas);
  if (loss == Loss::kHuber) return std::make_unique<ceres::HuberLoss>(options.huber_sigmas);
  return nullptr;
}

bool IsFinite(const State& state) {
  const auto is_finite = [](double value) { return std::isfinite(value); };
  for (const PoseBlock& pose : state.poses) {
    if (!std::all_of(pose.begin(), pose.end(), is_finite)) return false;
  }
  return std::all_of(state.numbers.begin(), state.numbers.end(), is_finite);
}

Eigen::Vector3d UpInBody(const CheckedNode& node, bool is_ground_level) {
  if (is_ground_level) return Eigen::Vector3d::UnitZ();
  return node.raw.orientation.conjugate() * Eigen::Vector3d::UnitZ();
}

// Returns a prior with independent coordinates, for the first node of a rover or of a part of its trajectory.
NodePrior StartOf(const Pose& map_from_node, double sigma_m, double sigma_tilt_rad, double sigma_yaw_rad) {
  NodePrior prior;
  prior.map_from_node = map_from_node;
  const auto sigmas =
      (Eigen::Matrix<double, 6, 1>() << sigma_m, sigma_m, sigma_m, sigma_tilt_rad, sigma_tilt_rad, sigma_yaw_rad)
          .finished();
  prior.covariance = sigmas.cwiseAbs2().asDiagonal();
  return prior;
}

}  // namespace

CostTerms::CostTerms(const CheckedGraph& graph, const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts,
                     const AgentFactsMap& agents, const InitialValues& initial, const std::vector<bool>& is_free,
                     const SolverOptions& options)
    : graph_(graph),
      options_(options),
      is_warm_(initial.is_mostly_warm),
      is_free_(is_free),
      is_window_(options.window_nodes > 0) {
  for (const Pose& pose : initial.poses) initial_.poses.push_back(ToBlock(pose));
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    if (graph.fixed_scales.contains(rovers[i].agent)) held_numbers_.insert(i);
    AddNumber(initial.scales[i], options.scale_sigma);
  }
  AddOdometry(rovers);
  AddRanges(agents, initial.biases_m);
  AddClosuresAndPriors();
  AddStartsAndGravity(rovers, starts);
}

void CostTerms::AddNumber(double value, double sigma) {
  initial_.numbers.push_back(value);
  if (is_window_) return;
  const int number = static_cast<int>(initial_.numbers.size()) - 1;
  terms_.push_back(Term{MakeZeroPriorFactor(sigma), kNone, kNone, number});
}

void CostTerms::AddOdometry(const std::vector<Rover>& rovers) {
  std::map<AgentId, int> scale_of;
  for (std::size_t i = 0; i < rovers.size(); ++i) scale_of[rovers[i].agent] = static_cast<int>(i);
  for (const CheckedOdometry& odometry : graph_.odometry) {
    const auto scale = scale_of.find(graph_.nodes[odometry.from].key.agent);
    if (!IsMoving(odometry.from, odometry.to)) continue;
    // Odometry without a scale belongs to a base station, which is stationary by configuration.
    if (scale == scale_of.end()) continue;
    terms_.push_back(Term{MakeOdometryFactor(odometry.from_from_to, odometry.edge->covariance),
                          static_cast<int>(odometry.from), static_cast<int>(odometry.to), scale->second});
  }
}

void CostTerms::AddRanges(const AgentFactsMap& agents, const PairNumbers& biases_m) {
  std::map<std::pair<AgentId, AgentId>, int> bias_of;
  for (const CheckedRange& range : graph_.ranges) {
    const AgentId a = graph_.nodes[range.from].key.agent;
    const AgentId b = graph_.nodes[range.to].key.agent;
    const auto [bias, is_new] = bias_of.try_emplace(std::minmax(a, b), static_cast<int>(initial_.numbers.size()));
    if (is_new) {
      const auto known = biases_m.find(std::minmax(a, b));
      AddNumber(known == biases_m.end() ? 0 : known->second, options_.bias_sigma_m);
    }
    AddTested(Term{MakeRangeFactor(range.edge->range_m, std::sqrt(range.edge->variance_m2), AntennaOf(agents, a),
                                   AntennaOf(agents, b)),
                   static_cast<int>(range.from), static_cast<int>(range.to), bias->second},
              IsMoving(range.from, range.to));
  }
}

void CostTerms::AddClosuresAndPriors() {
  for (const CheckedClosure& closure : graph_.closures) {
    AddTested(Term{MakeLoopClosureFactor(closure.from_from_to, closure.edge->covariance),
                   static_cast<int>(closure.from), static_cast<int>(closure.to)},
              IsMoving(closure.from, closure.to));
  }
  for (const CheckedPrior& prior : graph_.priors) {
    AddTested(Term{MakePriorFactor(*prior.prior), static_cast<int>(prior.node)}, is_free_[prior.node]);
  }
}

// Adds the term of the next tested factor, or notes that the factor is not part of this solve.
void CostTerms::AddTested(Term term, bool is_moving) {
  term.tested = static_cast<int>(tested_terms_.size());
  tested_terms_.push_back(is_moving ? terms_.size() : kNoTerm);
  if (is_moving) terms_.push_back(std::move(term));
}

void CostTerms::AddStartsAndGravity(const std::vector<Rover>& rovers, const std::vector<StartPrior>& starts) {
  const auto add = [this](std::unique_ptr<ceres::CostFunction> factor, std::size_t node) {
    if (!is_free_[node]) return;
    terms_.push_back(Term{std::move(factor), static_cast<int>(node)});
  };
  std::vector<bool> is_level(rovers.size(), options_.gravity_reference == GravityReference::kLevelGround);
  if (options_.gravity_reference == GravityReference::kChosen) {
    is_level = FindLevelGround(graph_, rovers, options_.gravity_sigma_rad);
  }
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    const Rover& rover = rovers[i];
    // Gravity determines roll and pitch better than a configured start, so the start prior has a large sigma for roll
    // and pitch.
    add(MakePriorFactor(
            StartOf(starts[i].map_from_node, starts[i].sigma_m, options_.loose_sigma_rad, starts[i].sigma_rad)),
        rover.first);
    for (const std::size_t head : rover.part_heads) {
      if (head == rover.first) continue;
      const Pose initial = FromBlock(initial_.poses[head]);
      add(MakePriorFactor(StartOf(initial, options_.loose_sigma_m, options_.loose_sigma_rad, options_.loose_sigma_rad)),
          head);
    }
    for (std::size_t node = rover.first; node < rover.first + rover.count; ++node) {
      if (!is_free_[node]) continue;
      add(MakeGravityFactor(UpInBody(graph_.nodes[node], is_level[i]), options_.gravity_sigma_rad), node);
    }
  }
}

bool CostTerms::IsUsed(const Term& term, const std::vector<bool>& is_used) const {
  return term.tested == kNone || is_used[static_cast<std::size_t>(term.tested)];
}

std::vector<double*> CostTerms::BlocksOf(const Term& term, State& state) {
  std::vector<double*> blocks;
  if (term.pose_a != kNone) blocks.push_back(state.poses[static_cast<std::size_t>(term.pose_a)].data());
  if (term.pose_b != kNone) blocks.push_back(state.poses[static_cast<std::size_t>(term.pose_b)].data());
  if (term.number != kNone) blocks.push_back(&state.numbers[static_cast<std::size_t>(term.number)]);
  return blocks;
}

void CostTerms::AddTerms(const std::vector<bool>& is_used, const std::vector<bool>& is_trusted,
                         ceres::LossFunction* loss, State& state, ceres::Problem& problem) const {
  const auto is_spared = [&](int tested) {
    return tested == kNone || (!is_trusted.empty() && is_trusted[static_cast<std::size_t>(tested)]);
  };
  for (const Term& term : terms_) {
    if (!IsUsed(term, is_used)) continue;
    problem.AddResidualBlock(term.factor.get(), is_spared(term.tested) ? nullptr : loss, BlocksOf(term, state));
  }
}

void CostTerms::HoldStanding(State& state, ceres::Problem& problem) const {
  const auto hold = [&problem](double* block) {
    if (problem.HasParameterBlock(block)) problem.SetParameterBlockConstant(block);
  };
  for (std::size_t node = 0; node < graph_.nodes.size(); ++node) {
    if (!is_free_[node]) hold(state.poses[node].data());
  }
  for (std::size_t i = 0; i < state.numbers.size(); ++i) {
    if (is_window_ || held_numbers_.contains(i)) hold(&state.numbers[i]);
  }
}

StageResult CostTerms::Minimise(const std::vector<bool>& is_used, const Stage& stage, State& state) const {
  const State begin = state;
  StageResult first = Try(is_used, stage, /*is_dogleg=*/false, state);
  if (first.has_converged || (options_.stop_requested && options_.stop_requested())) return first;
  state = begin;
  StageResult second = Try(is_used, stage, /*is_dogleg=*/true, state);
  second.iterations += first.iterations;
  return second;
}

void CostTerms::Build(const std::vector<bool>& is_used, const std::vector<bool>& is_trusted, ceres::LossFunction* loss,
                      PoseManifold& manifold, State& state, ceres::Problem& problem) const {
  for (std::size_t node = 0; node < graph_.nodes.size(); ++node) {
    if (is_free_[node]) problem.AddParameterBlock(state.poses[node].data(), kPoseSize, &manifold);
  }
  AddTerms(is_used, is_trusted, loss, state, problem);
  HoldStanding(state, problem);
}

LinearTerms CostTerms::Linearise(const std::vector<bool>& is_used, State state) const {
  PoseManifold manifold;
  ceres::Problem problem(BorrowingProblemOptions());
  Build(is_used, {}, nullptr, manifold, state, problem);
  ceres::Problem::EvaluateOptions evaluation;
  evaluation.num_threads = options_.thread_count;
  for (std::size_t node = 0; node < graph_.nodes.size(); ++node) {
    if (is_free_[node]) evaluation.parameter_blocks.push_back(state.poses[node].data());
  }
  for (std::size_t i = 0; i < state.numbers.size(); ++i) {
    if (HasColumn(i) && problem.HasParameterBlock(&state.numbers[i])) {
      evaluation.parameter_blocks.push_back(&state.numbers[i]);
    }
  }
  LinearTerms result;
  std::vector<double> residuals;
  ceres::CRSMatrix rows;
  if (!problem.Evaluate(evaluation, nullptr, &residuals, nullptr, &rows)) return result;
  result.jacobian = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
      rows.num_rows, rows.num_cols, static_cast<Eigen::Index>(rows.values.size()), rows.rows.data(), rows.cols.data(),
      rows.values.data());
  result.residuals = Eigen::Map<Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size()));
  for (const Term& term : terms_) {
    if (!IsUsed(term, is_used)) continue;
    result.tested_of_row.insert(result.tested_of_row.end(), static_cast<std::size_t>(term.factor->num_residuals()),
                                term.tested);
  }
  return result;
}

State CostTerms::Move(const State& state, const Eigen::VectorXd& move) const {
  State moved = state;
  const PoseManifold manifold;
  Eigen::Index column = 0;
  for (std::size_t node = 0; node < graph_.nodes.size(); ++node) {
    if (!is_free_[node]) continue;
    manifold.Plus(state.poses[node].data(), move.data() + column, moved.poses[node].data());
    column += kPoseTangentSize;
  }
  for (std::size_t i = 0; i < state.numbers.size() && column < move.size(); ++i) {
    if (HasColumn(i)) moved.numbers[i] += move(column++);
  }
  return moved;
}

std::vector<Matrix6d> CostTerms::Covariances(const std::vector<bool>& is_used, const std::vector<std::size_t>& nodes,
                                             const State& state) const {
  LinearTerms terms = Linearise(is_used, state);
  const Eigen::Index columns = terms.jacobian.cols();
  const auto linear = Linearization::Make(std::move(terms));
  if (linear == nullptr) return {};
  std::vector<Matrix6d> covariances;
  for (const std::size_t node : nodes) {
    const auto column =
        kPoseTangentSize * std::count(is_free_.begin(), is_free_.begin() + static_cast<std::ptrdiff_t>(node), true);
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(columns, kPoseTangentSize);
    unit.middleRows(column, kPoseTangentSize).setIdentity();
    covariances.emplace_back(linear->Solve(unit).middleRows(column, kPoseTangentSize));
    if (!covariances.back().allFinite()) return {};
  }
  return covariances;
}

StageResult CostTerms::Try(const std::vector<bool>& is_used, const Stage& stage, bool is_dogleg, State& state) const {
  PoseManifold manifold;
  const std::unique_ptr<ceres::LossFunction> loss = MakeLoss(stage.loss, options_);
  ceres::Problem problem(BorrowingProblemOptions());
  Build(is_used, stage.is_trusted, loss.get(), manifold, state, problem);
  ceres::Solver::Options solve_options = SolveOptions(options_, stage, is_dogleg);
  StopCallback stop(options_.stop_requested);
  if (options_.stop_requested) solve_options.callbacks.push_back(&stop);
  ceres::Solver::Summary summary;
  ceres::Solve(solve_options, &problem, &summary);

  StageResult result;
  result.has_converged = summary.termination_type == ceres::CONVERGENCE && IsFinite(state);
  result.iterations = static_cast<int>(summary.iterations.size());
  if (!result.has_converged) result.text = summary.message;
  return result;
}

double CostTerms::Cost(const std::vector<bool>& is_used, const State& state) const {
  State copy = state;  // Ceres needs mutable blocks.
  double square_sum = 0;
  std::array<double, 6> residuals{};
  for (const Term& term : terms_) {
    if (!IsUsed(term, is_used)) continue;
    term.factor->Evaluate(BlocksOf(term, copy).data(), residuals.data(), nullptr);
    for (int i = 0; i < term.factor->num_residuals(); ++i) square_sum += residuals[i] * residuals[i];
  }
  return square_sum / 2;
}

double CostTerms::RobustCost(const std::vector<bool>& is_allowed, const State& state) const {
  double cost = Cost(std::vector<bool>(tested_terms_.size(), false), state);
  const double scale = options_.cauchy_sigmas * options_.cauchy_sigmas;
  const std::vector<double> residuals = TestedResiduals(state);
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (is_allowed[i]) cost += scale / 2 * std::log1p(residuals[i] * residuals[i] / scale);
  }
  return cost;
}

std::map<AgentId, double> CostTerms::RobustCosts(const std::vector<bool>& is_counted, const State& state) const {
  State copy = state;
  std::map<AgentId, double> costs;
  const double scale = options_.cauchy_sigmas * options_.cauchy_sigmas;
  for (const Term& term : terms_) {
    if (term.pose_a == kNone || !IsUsed(term, is_counted)) continue;
    Eigen::Matrix<double, 6, 1> whitened = Eigen::Matrix<double, 6, 1>::Zero();
    term.factor->Evaluate(BlocksOf(term, copy).data(), whitened.data(), nullptr);
    const double square = whitened.squaredNorm();
    const bool is_tested = term.tested != kNone;
    const AgentId agent = is_tested ? graph_.ProducerOfTested(static_cast<std::size_t>(term.tested))
                                    : graph_.nodes[static_cast<std::size_t>(term.pose_a)].key.agent;
    costs[agent] += is_tested ? scale / 2 * std::log1p(square / scale) : square / 2;
  }
  return costs;
}

std::vector<double> CostTerms::TestedResiduals(const State& state) const {
  State copy = state;
  std::vector<double> residuals(tested_terms_.size());
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (tested_terms_[i] == kNoTerm) continue;
    const Term& term = terms_[tested_terms_[i]];
    Eigen::Matrix<double, 6, 1> whitened = Eigen::Matrix<double, 6, 1>::Zero();
    term.factor->Evaluate(BlocksOf(term, copy).data(), whitened.data(), nullptr);
    residuals[i] = term.factor->num_residuals() == 1 ? whitened(0) : whitened.norm();
  }
  return residuals;
}

}  // namespace moondb
