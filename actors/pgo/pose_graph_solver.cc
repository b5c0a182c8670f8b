#include "actors/pgo/pose_graph_solver.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/range_tests.h"
#include "actors/pgo/rover_status.h"
#include "actors/pgo/unknown_starts.h"

namespace moondb {

namespace {

constexpr int kTestsMax = 10;  // Of the ranges; two or three are usual.
// From this share of known nodes on, the last verdicts are worth more than a robust stage.
constexpr double kWarmShare = 0.8;
// Of a start that nobody knows: far beyond any mission, so that it costs nothing.
constexpr double kFreeSigmaM = 1e4;
constexpr double kFreeSigmaRad = 100;

// Costs are sums of squares; below this part of them is rounding.
bool IsHigher(double cost, double reference) { return cost > reference * (1 + 1e-6) + 1e-9; }

// From the ranges between nodes of the last solution that it accepted.
PairNumbers EstimateWarmBiases(const CheckedGraph& graph, const AgentFactsMap& agents, const InitialValues& initial,
                               const LastSolution& last, const SolverOptions& options) {
  std::vector<bool> counts;
  for (const CheckedRange& range : graph.ranges) {
    const auto is_known = [&](std::size_t node) { return initial.is_warm[node] || graph.nodes[node].is_fixed; };
    counts.push_back(is_known(range.from) && is_known(range.to) &&
                     !last.rejected.contains({range.edge->from, range.edge->to}));
  }
  return EstimateBiases(graph, agents, initial.poses, counts, options.bias_sigma_m);
}

struct StagedResult {
  bool is_accepted = false;
  std::string text;
  State state;
  std::vector<bool> is_inlier;
  double initial_cost = 0;
  double final_cost = 0;
  int iterations = 0;
};

// `first_inliers`: where the solve goes on from one before; else ranges are judged after a robust stage.
StagedResult SolveInStages(const CostTerms& terms, const CheckedGraph& graph,
                           const std::optional<std::vector<bool>>& first_inliers, const SolverOptions& options) {
  StagedResult result;
  result.state = terms.initial();
  result.is_inlier.assign(graph.ranges.size(), true);
  StageResult stage;
  stage.has_converged = true;
  Stage next = terms.FirstStage(Loss::kNone);
  if (first_inliers) {
    result.is_inlier = *first_inliers;
  } else if (!graph.ranges.empty()) {
    Stage robust = terms.FirstStage(Loss::kCauchyOnRanges);
    robust.is_rough = true;
    stage = terms.Minimise(result.is_inlier, robust, result.state);
    result.iterations += stage.iterations;
    result.is_inlier = FindInliers(graph, terms, terms.RangeResiduals(result.state), result.is_inlier, options);
    next.is_near = true;
  }
  for (int test = 0; stage.has_converged && test < kTestsMax; ++test) {
    stage = terms.Minimise(result.is_inlier, next, result.state);
    result.iterations += stage.iterations;
    next.is_near = true;
    std::vector<bool> is_inlier =
        FindInliers(graph, terms, terms.RangeResiduals(result.state), result.is_inlier, options);
    if (is_inlier == result.is_inlier) break;
    if (test + 1 < kTestsMax) result.is_inlier = std::move(is_inlier);
  }
  if (!stage.has_converged) {
    result.text = "did not converge: " + stage.text;
    return result;
  }
  result.initial_cost = terms.Cost(result.is_inlier, terms.initial());
  result.final_cost = terms.Cost(result.is_inlier, result.state);
  result.is_accepted = std::isfinite(result.final_cost) && !IsHigher(result.final_cost, result.initial_cost);
  if (!result.is_accepted) result.text = "the cost did not fall";
  return result;
}

std::vector<RangeVerdict> JudgeRanges(const CheckedGraph& graph, const CostTerms& terms, const StagedResult& staged) {
  const std::vector<double> residuals = terms.RangeResiduals(staged.state);
  std::vector<RangeVerdict> verdicts;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (!terms.HasRange(i)) continue;
    const RangeEdge& edge = *graph.ranges[i].edge;
    verdicts.push_back(RangeVerdict{edge.from, edge.to, staged.is_inlier[i], residuals[i]});
  }
  return verdicts;
}

std::vector<bool> FindFree(const CheckedGraph& graph, const std::vector<Rover>& rovers, std::size_t window_nodes) {
  std::vector<bool> is_free(graph.nodes.size(), false);
  for (const Rover& rover : rovers) {
    const std::size_t count = window_nodes == 0 ? rover.count : std::min(rover.count, window_nodes);
    for (std::size_t i = 0; i < count; ++i) is_free[rover.first + rover.count - 1 - i] = true;
  }
  return is_free;
}

// One beginning and where it led.
struct Attempt {
  StagedResult staged;
  std::vector<RangeVerdict> ranges;
  double robust_cost = 0;
  std::map<NodeKey, Matrix6d> covariances;
};

// A rover whose start nobody knows is held where this beginning has it, and so loosely that it costs nothing.
std::vector<StartPrior> StartsAt(std::vector<StartPrior> starts, const std::vector<Rover>& rovers,
                                 const std::vector<std::size_t>& unknown, const InitialValues& initial) {
  for (const std::size_t i : unknown) {
    starts[i].map_from_node = initial.poses[rovers[i].first];
    starts[i].sigma_m = kFreeSigmaM;
    starts[i].sigma_rad = kFreeSigmaRad;
  }
  return starts;
}

// Rovers that two solutions set down apart.
std::set<AgentId> FindApart(const CheckedGraph& graph, const State& a, const State& b) {
  std::set<AgentId> apart;
  for (std::size_t node = 0; node < graph.nodes.size(); ++node) {
    const double distance_m = (FromBlock(a.poses[node]).position_m - FromBlock(b.poses[node]).position_m).norm();
    if (distance_m > kApartM) apart.insert(graph.nodes[node].key.agent);
  }
  return apart;
}

class Solver {
 public:
  Solver(const PoseGraph& graph, const AgentFactsMap& agents, const LastSolution& last, const SolverOptions& options)
      : agents_(agents), last_(last), options_(options), checked_(CheckGraph(graph, agents)) {
    rovers_ = FindRovers(checked_);
    const LoosePrior loose{options.loose_sigma_m, options.loose_sigma_rad};
    for (const Rover& rover : rovers_) starts_.push_back(FindStartPrior(checked_.nodes[rover.first], agents, loose));
    initial_ = FindInitialValues(checked_, rovers_, starts_, last.poses);
    is_warm_ = static_cast<double>(initial_.warm_count) >= kWarmShare * static_cast<double>(checked_.nodes.size());
    if (is_warm_) initial_.biases_m = EstimateWarmBiases(checked_, agents, initial_, last, options);
  }

  Solution Run() {
    solution_.left_out = checked_.left_out;
    solution_.node_count = checked_.nodes.size();
    solution_.odometry_count = checked_.odometry.size();
    solution_.range_count = checked_.ranges.size();
    std::vector<Pose> poses = initial_.poses;
    std::vector<double> scales = initial_.scales;
    if (rovers_.empty()) {
      solution_.is_accepted = true;
      solution_.text = "no rover has a node yet";
    } else {
      Take(Best(), poses, scales);
    }
    solution_.rovers = JudgeRovers(checked_, rovers_, starts_, solution_.ranges, scales, ambiguous_);
    solution_.rejected_range_count = static_cast<std::size_t>(std::count_if(
        solution_.ranges.begin(), solution_.ranges.end(), [](const auto& range) { return !range.is_inlier; }));
    for (std::size_t node = 0; node < poses.size(); ++node) {
      solution_.poses.emplace(checked_.nodes[node].key, poses[node]);
    }
    return std::move(solution_);
  }

 private:
  Attempt Best() {
    const std::vector<std::size_t> unknown = FindUnknownRovers(rovers_, starts_, initial_);
    if (is_warm_) solution_.beginning = SolveBeginning::kLastSolution;
    if (unknown.empty() || checked_.ranges.empty()) return Try(initial_, starts_);
    const std::vector<InitialValues> beginnings = ArrangeUnknownRovers(checked_, rovers_, unknown, agents_, initial_);
    if (beginnings.size() == 1) return Try(initial_, starts_);
    std::vector<Attempt> attempts;
    std::size_t best = 0;
    for (const InitialValues& beginning : beginnings) {
      attempts.push_back(Try(beginning, StartsAt(starts_, rovers_, unknown, beginning)));
      if (IsBetter(attempts.back(), attempts[best])) best = attempts.size() - 1;
    }
    if (best > 0) solution_.beginning = SolveBeginning::kArrangedRovers;
    for (const Attempt& attempt : attempts) {
      const bool is_near = attempt.robust_cost - attempts[best].robust_cost < options_.ambiguous_cost;
      if (!attempt.staged.is_accepted || !is_near) continue;
      ambiguous_.merge(FindApart(checked_, attempt.staged.state, attempts[best].staged.state));
    }
    return std::move(attempts[best]);
  }

  static bool IsBetter(const Attempt& a, const Attempt& b) {
    if (a.staged.is_accepted != b.staged.is_accepted) return a.staged.is_accepted;
    return a.robust_cost < b.robust_cost;
  }

  Attempt Try(const InitialValues& initial, const std::vector<StartPrior>& starts) const {
    const CostTerms terms(checked_, rovers_, starts, agents_, initial,
                          FindFree(checked_, rovers_, options_.window_nodes), options_);
    std::optional<std::vector<bool>> first_inliers;
    if (is_warm_) {
      first_inliers = FindFirstInliers(checked_, initial, terms.RangeResiduals(terms.initial()), last_, options_);
    }
    Attempt attempt;
    attempt.staged = SolveInStages(terms, checked_, first_inliers, options_);
    if (!attempt.staged.is_accepted) return attempt;
    attempt.ranges = JudgeRanges(checked_, terms, attempt.staged);
    attempt.robust_cost = terms.RobustCost(attempt.staged.state);
    if (!options_.covariance_of.empty()) attempt.covariances = CovariancesOf(terms, attempt.staged);
    return attempt;
  }

  std::map<NodeKey, Matrix6d> CovariancesOf(const CostTerms& terms, const StagedResult& staged) const {
    std::vector<std::size_t> nodes;
    for (const NodeKey& key : options_.covariance_of) {
      if (const std::optional<std::size_t> node = checked_.Find(key)) nodes.push_back(*node);
    }
    const std::vector<Matrix6d> found = terms.Covariances(staged.is_inlier, nodes, staged.state);
    std::map<NodeKey, Matrix6d> covariances;
    for (std::size_t i = 0; i < found.size(); ++i) covariances[checked_.nodes[nodes[i]].key] = found[i];
    return covariances;
  }

  void Take(Attempt attempt, std::vector<Pose>& poses, std::vector<double>& scales) {
    solution_.is_accepted = attempt.staged.is_accepted;
    solution_.text = attempt.staged.text;
    solution_.initial_cost = attempt.staged.initial_cost;
    solution_.final_cost = attempt.staged.final_cost;
    solution_.iterations = attempt.staged.iterations;
    if (!attempt.staged.is_accepted) return;
    for (std::size_t node = 0; node < poses.size(); ++node) poses[node] = FromBlock(attempt.staged.state.poses[node]);
    std::copy_n(attempt.staged.state.numbers.begin(), scales.size(), scales.begin());
    solution_.ranges = std::move(attempt.ranges);
    solution_.covariances = std::move(attempt.covariances);
  }

  const AgentFactsMap& agents_;
  const LastSolution& last_;
  const SolverOptions& options_;
  const CheckedGraph checked_;
  std::vector<Rover> rovers_;
  std::vector<StartPrior> starts_;
  InitialValues initial_;
  bool is_warm_ = false;
  std::set<AgentId> ambiguous_;
  Solution solution_;
};

}  // namespace

std::string ToString(SolveBeginning beginning) {
  switch (beginning) {
    case SolveBeginning::kOdometry:
      return "odometry";
    case SolveBeginning::kLastSolution:
      return "warm";
    case SolveBeginning::kArrangedRovers:
      return "stage 0";
  }
  return "unknown";
}

LastSolution ToLast(const Solution& solution) {
  LastSolution last;
  last.poses = solution.poses;
  for (const RangeVerdict& range : solution.ranges) {
    if (!range.is_inlier) last.rejected.insert({range.from, range.to});
  }
  return last;
}

Solution SolvePoseGraph(const PoseGraph& graph, const AgentFactsMap& agents, const LastSolution& last,
                        const SolverOptions& options) {
  return Solver(graph, agents, last, options).Run();
}

}  // namespace moondb
