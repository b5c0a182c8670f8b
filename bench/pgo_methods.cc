#include "bench/pgo_methods.h"

#include <algorithm>

#include "actors/pgo/cost_terms.h"
#include "model/check.h"
#include "model/metrics.h"

namespace moondb {
namespace {

Loss LossOf(Method method) {
  if (method == Method::kHuber) return Loss::kHuber;
  return method == Method::kCauchy ? Loss::kCauchy : Loss::kNone;
}

MethodResult SolveOnce(Loss loss, const PoseGraph& graph, const AgentFactsMap& agents, const SolverOptions& options) {
  const CheckedGraph checked = CheckGraph(graph, agents);
  const std::vector<Rover> rovers = FindRovers(checked);
  std::vector<StartPrior> starts;
  for (const Rover& rover : rovers) starts.push_back(FindStartPrior(checked.nodes[rover.first], agents, {}));
  const InitialValues initial = FindInitialValues(checked, rovers, starts, {});
  std::vector<bool> is_free;
  for (const CheckedNode& node : checked.nodes) is_free.push_back(!node.is_fixed);
  const CostTerms terms(checked, rovers, starts, agents, initial, is_free, options);
  const std::vector<bool> all(checked.tested_count(), true);
  State state = terms.initial();
  MethodResult result;
  result.has_converged = terms.Minimise(all, terms.FirstStage(loss), state).has_converged;
  result.cost = terms.Cost(all, state);
  for (std::size_t i = 0; i < checked.nodes.size(); ++i) result.poses[checked.nodes[i].key] = FromBlock(state.poses[i]);
  return result;
}

}  // namespace

std::string ToString(Method method) {
  switch (method) {
    case Method::kOdometry:
      return "odometry";
    case Method::kLeastSquares:
      return "least squares";
    case Method::kHuber:
      return "Huber";
    case Method::kCauchy:
      return "Cauchy";
    case Method::kStaged:
      return "staged";
  }
  return "unknown";
}

MethodResult SolveWith(Method method, const PoseGraph& graph, const AgentFactsMap& agents,
                       const SolverOptions& options) {
  MethodResult result;
  if (method == Method::kOdometry) {
    result.has_converged = true;
    result.poses = PosesOf(graph);
  } else if (method == Method::kStaged) {
    Solution solution;
    result.seconds = SecondsOf([&] { solution = SolvePoseGraph(graph, agents, {}, options); });
    result.has_converged = solution.is_accepted;
    result.cost = solution.final_cost;
    result.poses = std::move(solution.poses);
    result.verdicts = std::move(solution.verdicts);
  } else {
    const double seconds = SecondsOf([&] { result = SolveOnce(LossOf(method), graph, agents, options); });
    result.seconds = seconds;
  }
  return result;
}

MethodFigures ToFigures(std::vector<double> ates_m, std::vector<double> seconds) {
  if (ates_m.empty()) return {};
  const double worst_m = *std::max_element(ates_m.begin(), ates_m.end());
  return {Median(std::move(ates_m)), worst_m, Median(std::move(seconds))};
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

}  // namespace moondb
