// Ceres options that all solves in this folder share.
#pragma once

#include <ceres/iteration_callback.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <functional>

namespace moondb {

// Initial trust region radii. kBoldTrustRegion gives nearly Gauss-Newton steps, for good initial values.
// kCarefulTrustRegion is for initial values from odometry only.
inline constexpr double kBoldTrustRegion = 1e16;
inline constexpr double kCarefulTrustRegion = 1e4;

// Aborts a solve once `stop_requested` returns true. `stop_requested` must outlive this object.
class StopCallback final : public ceres::IterationCallback {
 public:
  explicit StopCallback(const std::function<bool()>& stop_requested) : stop_requested_(stop_requested) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override;

 private:
  const std::function<bool()>& stop_requested_;
};

// Returns options of a problem that does not own its factors, losses and manifolds. The caller must keep them alive.
ceres::Problem::Options BorrowingProblemOptions();

// Returns options for sparse Cholesky without log output. The tolerances are tight enough for shallow valleys of the
// cost.
ceres::Solver::Options LeastSquaresOptions(int thread_count, int iterations_max);

}  // namespace moondb
