#include "actors/pgo/planar_descent.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace moondb {

namespace {

constexpr double kFunctionTolerance = 1e-9;
constexpr double kStepTolerance = 1e-9;  // Tolerance relative to the norm of all unknowns.
constexpr double kGradientTolerance = 1e-10;
constexpr double kRoundingPart = 1e-13;  // Rounding error of F, as a fraction of F.
constexpr double kRadiusMax = 1e16;
constexpr double kRadiusMin = 1e-32;
constexpr double kDiagonalMin = 1e-6;
constexpr double kNearPart = 1e-2;  // A step that lowers F by at most this fraction ends near the minimum.
constexpr int kWaitMax = 64;

class Descent {
 public:
  Descent(PlanarSystem& system, const PlanarDescentOptions& options, PlanarState& state)
      : system_(system), options_(options), state_(state), radius_(options.trust_region_radius) {}

  PlanarDescent Run() {
    result_.cost = system_.Cost(state_);
    if (!std::isfinite(result_.cost)) return result_;
    damped_ = system_.normal().lower();
    factorised_.analyzePattern(damped_);
    system_.Linearise(state_, curvature_);
    for (; result_.iterations < options_.iterations_max && !result_.has_converged; ++result_.iterations) {
      if (options_.stop_requested && options_.stop_requested()) break;
      if (system_.gradient().size() == 0 || system_.gradient().lpNorm<Eigen::Infinity>() <= kGradientTolerance) {
        result_.has_converged = true;
      } else if (radius_ < kRadiusMin) {
        break;
      } else {
        Step();
      }
    }
    return result_;
  }

 private:
  void Step() {
    Eigen::VectorXd step;
    const double expected = Solve(step);
    if (!(expected > 0)) return RejectStep();
    result_.has_converged = step.norm() <= kStepTolerance * SizeOf(state_);
    if (result_.has_converged) return;
    PlanarState moved = system_.Plus(state_, step);
    system_.SettlePositions(moved);
    const double cost = system_.Cost(moved);
    const double cost_decrease = result_.cost - cost;
    if (!(cost_decrease >= 0)) {
      const bool is_least = -cost_decrease <= kRoundingPart * result_.cost || expected <= kRoundingPart * result_.cost;
      result_.has_converged = is_least && std::isfinite(cost);
      return RejectStep();
    }
    result_.has_converged = std::max(cost_decrease, expected) <= kFunctionTolerance * result_.cost;
    const double gain_ratio = std::min(cost_decrease / expected, 1.0);
    radius_ = std::min(kRadiusMax, radius_ / std::max(1.0 / 3, 1 - std::pow(2 * gain_ratio - 1, 3)));
    shrink_ = 2;
    result_.cost = cost;
    state_ = std::move(moved);
    if (gauss_newton_steps_ > 0) --gauss_newton_steps_;
    const bool is_exact = gauss_newton_steps_ == 0 && cost_decrease <= kNearPart * cost;
    curvature_ = is_exact ? Curvature::kExact : Curvature::kGaussNewton;
    system_.Linearise(state_, curvature_);
  }

  static double SizeOf(const PlanarState& state) {
    double square_sum = 0;
    for (const Eigen::Vector3d& place : state) square_sum += place.squaredNorm();
    return std::sqrt(square_sum);
  }

  // Rejects a step. If the step used the exact curvature, switches to Gauss-Newton for some steps. Otherwise the step
  // was too long, and the radius is reduced.
  void RejectStep() {
    if (curvature_ == Curvature::kExact) {
      curvature_ = Curvature::kGaussNewton;
      gauss_newton_steps_ = wait_;
      wait_ = std::min(2 * wait_, kWaitMax);
      system_.Linearise(state_, curvature_);
      return;
    }
    radius_ /= shrink_;
    shrink_ *= 2;
  }

  // Computes the next step. Returns the decrease of F that the linearisation predicts for this step; not positive if no
  // step was found.
  double Solve(Eigen::VectorXd& step) {
    const Eigen::SparseMatrix<double>& normal = system_.normal().lower();
    std::copy(normal.valuePtr(), normal.valuePtr() + normal.nonZeros(), damped_.valuePtr());
    Eigen::VectorXd damping(normal.cols());
    for (Eigen::Index i = 0; i < normal.cols(); ++i) {
      double& value = damped_.valuePtr()[damped_.outerIndexPtr()[i]];
      damping[i] = std::max(value, kDiagonalMin) / radius_;
      value += damping[i];
    }
    factorised_.factorize(damped_);
    if (factorised_.info() != Eigen::Success) return 0;
    step = -factorised_.solve(system_.gradient());
    return step.dot(damping.cwiseProduct(step)) - step.dot(system_.gradient());
  }

  PlanarSystem& system_;
  const PlanarDescentOptions& options_;
  PlanarState& state_;
  double radius_;
  double shrink_ = 2;
  Curvature curvature_ = Curvature::kGaussNewton;
  int gauss_newton_steps_ = 0;  // Number of Gauss-Newton steps before the exact curvature is tried again.
  // Value that gauss_newton_steps_ gets when the next step with exact curvature is rejected.
  int wait_ = 1;
  Eigen::SparseMatrix<double> damped_;
  OrderedCholesky factorised_;
  PlanarDescent result_;
};

}  // namespace

PlanarDescent MinimisePlanar(PlanarSystem& system, const PlanarDescentOptions& options, PlanarState& state) {
  return Descent(system, options, state).Run();
}

}  // namespace moondb
