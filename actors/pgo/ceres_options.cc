#include "actors/pgo/ceres_options.h"

#include "actors/pgo/manifold.h"

namespace moondb {

ceres::CallbackReturnType StopCallback::operator()(const ceres::IterationSummary&) {
  return stop_requested_() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
}

ceres::Problem::Options BorrowingProblemOptions() {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ManifoldOwnership(options) = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

ceres::Solver::Options LeastSquaresOptions(int thread_count, int iterations_max) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
#ifdef MOONDB_EIGEN_SPARSE
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
#else
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
#endif
  options.num_threads = thread_count;
  options.max_num_iterations = iterations_max;
  // Ranges leave shallow valleys in the cost. Ceres's default tolerance of 1e-6 stops too early in such valleys.
  options.function_tolerance = 1e-9;
  options.parameter_tolerance = 1e-9;
  options.logging_type = ceres::SILENT;
  return options;
}

}  // namespace moondb
