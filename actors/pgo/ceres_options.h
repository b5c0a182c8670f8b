// What all solves with Ceres here have in common.
#pragma once

#include <ceres/iteration_callback.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <functional>

namespace moondb {

// Nearly Gauss-Newton, where the start is good; and careful, where it is bare odometry.
inline constexpr double kBoldTrustRegion = 1e16;
inline constexpr double kCarefulTrustRegion = 1e4;

// Ends a solve when asked to. `stop_requested` must outlive it.
class StopCallback final : public ceres::IterationCallback {
 public:
  explicit StopCallback(const std::function<bool()>& stop_requested) : stop_requested_(stop_requested) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override;

 private:
  const std::function<bool()>& stop_requested_;
};

// Factors, losses and manifolds stay the caller's.
ceres::Problem::Options BorrowingProblemOptions();

// Sparse Cholesky, silent, tolerances for shallow valleys.
ceres::Solver::Options LeastSquaresOptions(int thread_count, int iterations_max);

}  // namespace moondb
