// Methods of solving a team's graph that pgo_bench compares. Least squares, Huber and Cauchy run Ceres once, from the
// poses of the odometry and with the same factors.
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "actors/pgo/pose_graph_solver.h"
#include "model/mission.h"

namespace moondb {

enum class Method { kOdometry, kLeastSquares, kHuber, kCauchy, kStaged };

inline constexpr Method kMethods[] = {Method::kOdometry, Method::kLeastSquares, Method::kHuber, Method::kCauchy,
                                      Method::kStaged};

std::string ToString(Method method);

struct MethodResult {
  bool has_converged = false;
  double cost = 0;
  double seconds = 0;
  std::map<NodeKey, Pose> poses;
  std::vector<FactorVerdict> verdicts;  // Filled only with Method::kStaged.
};

MethodResult SolveWith(Method method, const PoseGraph& graph, const AgentFactsMap& agents,
                       const SolverOptions& options);

// Statistics of one method over many runs.
struct MethodFigures {
  double median_ate_m = 0;
  double worst_ate_m = 0;
  double median_seconds = 0;
};

MethodFigures ToFigures(std::vector<double> ates_m, std::vector<double> seconds);

// Returns the median; 0 if `values` is empty.
double Median(std::vector<double> values);

template <typename Work>
double SecondsOf(const Work& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace moondb
