#include "actors/pgo/pose_graph_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/keep_still.h"
#include "actors/pgo/range_tests.h"
#include "actors/pgo/rover_status.h"
#include "actors/pgo/staged_solve.h"
#include "actors/pgo/unknown_starts.h"

namespace moondb {

namespace {

// Prior sigmas of an unknown start: far beyond the size of any mission, so the prior costs nothing.
constexpr double kFreeSigma_m = 1e4;
constexpr double kFreeSigma_rad = 100;

// Estimates the biases from the accepted ranges between nodes of the last solution.
PairNumbers EstimateWarmBiases(const CheckedGraph& graph, const AgentFactsMap& agents, const InitialValues& initial,
                               const LastSolution& last, const SolverOptions& options) {
  std::vector<bool> counts;
  for (const CheckedRange& range : graph.ranges) {
    counts.push_back(IsKnown(graph, initial, range.from) && IsKnown(graph, initial, range.to) &&
                     !last.rejected.contains({range.edge->from, range.edge->to}));
  }
  return EstimateBiases(graph, agents, initial.poses, counts, options.bias_sigma_m);
}

// Returns one flag per node: true if the node is variable. If `window_nodes` is 0, all nodes of rovers are variable.
// Otherwise only the newest `window_nodes` nodes of each rover, and nodes without a pose from the last solution, are
// variable. Nodes of base stations are never variable.
std::vector<bool> FindFree(const CheckedGraph& graph, const std::vector<Rover>& rovers, const InitialValues& initial,
                           std::size_t window_nodes) {
  std::vector<bool> is_free(graph.nodes.size(), false);
  for (const Rover& rover : rovers) {
    const std::size_t end = rover.first + rover.count;
    for (std::size_t node = rover.first; node < end; ++node) {
      is_free[node] = window_nodes == 0 || end - node <= window_nodes || !initial.is_warm[node];
    }
  }
  return is_free;
}

// Returns the verdicts on the ranges that took part in the solve, or on all ranges if `is_all`. A range that did not
// take part keeps its previous verdict.
std::vector<RangeVerdict> FindVerdicts(const CheckedGraph& graph, const CostTerms& terms, const StagedResult& staged,
                                       bool is_all) {
  const std::vector<double> residuals = terms.RangeResiduals(staged.state);
  std::vector<RangeVerdict> verdicts;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (!is_all && !terms.HasRange(i)) continue;
    const RangeEdge& edge = *graph.ranges[i].edge;
    verdicts.push_back(RangeVerdict{edge.from, edge.to, staged.is_inlier[i], residuals[i]});
  }
  return verdicts;
}

// Returns the rovers with at least one node whose positions in the two solutions are more than kApart_m apart.
std::set<AgentId> FindApart(const CheckedGraph& graph, const State& a, const State& b) {
  std::set<AgentId> apart;
  for (std::size_t node = 0; node < graph.nodes.size(); ++node) {
    const double distance_m = (FromBlock(a.poses[node]).position_m - FromBlock(b.poses[node]).position_m).norm();
    if (distance_m > kApart_m) apart.insert(graph.nodes[node].key.agent);
  }
  return apart;
}

// One solve from one set of initial values, and its result.
struct Attempt {
  SolveInitialValues initial_values = SolveInitialValues::kOdometry;
  InitialValues initial;
  std::vector<StartPrior> starts;
  SolverOptions options;  // The caller's options, with window_nodes of this attempt.
  std::unique_ptr<CostTerms> terms;
  StagedResult staged;
  // Robust cost of the solution. If the attempt was not accepted, the robust cost at its initial values.
  double robust_cost = std::numeric_limits<double>::infinity();
  std::set<AgentId> ambiguous;  // Rovers that another attempt places elsewhere at nearly the same cost.
};

// Attempts are held by pointer: they must not move in memory, because `terms` refers to `options` of the same object.
using AttemptPointer = std::unique_ptr<Attempt>;

class Solver {
 public:
  Solver(const PoseGraph& graph, const AgentFactsMap& agents, const LastSolution& last, const SolverOptions& options)
      : agents_(agents), last_(last), options_(options), checked_(CheckGraph(graph, agents)) {
    rovers_ = FindRovers(checked_);
    const LoosePrior loose{options.loose_sigma_m, options.loose_sigma_rad};
    for (const Rover& rover : rovers_) starts_.push_back(FindStartPrior(checked_.nodes[rover.first], agents, loose));
    unknown_ = FindUnknownRovers(checked_, rovers_, starts_);
    initial_ = FindInitialValues(checked_, rovers_, starts_, last.poses);
    if (initial_.is_mostly_warm) initial_.biases_m = EstimateWarmBiases(checked_, agents, initial_, last, options);
  }

  Solution Run() {
    solution_.left_out = checked_.left_out;
    solution_.node_count = checked_.nodes.size();
    solution_.odometry_count = checked_.odometry.size();
    solution_.range_count = checked_.ranges.size();
    if (rovers_.empty()) {
      solution_.is_accepted = true;
      solution_.text = "no rover has a node yet";
      TakePoses([this](std::size_t node) { return initial_.poses[node]; });
    } else {
      Take(*Best());
    }
    return std::move(solution_);
  }

 private:
  bool IsStopped() const { return options_.stop_requested && options_.stop_requested(); }

  // Solves from the last solution. If the result is suspect, also solves from odometry and returns the better attempt.
  AttemptPointer Best() const {
    AttemptPointer best = BestFrom(initial_);
    if (!initial_.has_warm || IsStopped() || !IsSuspect(*best)) return best;
    AttemptPointer cold = BestFrom(FindInitialValues(checked_, rovers_, starts_, {}));
    // If `best` was not accepted, its robust cost is the cost at its initial values. The negative margin then accepts a
    // cold solution of about the same cost.
    const double margin = best->staged.is_accepted ? options_.ambiguous_cost : -options_.still_cost;
    return IsBetter(*cold, *best, margin) ? std::move(cold) : std::move(best);
  }

  // Solves from `initial`, and from each arrangement of the rovers without a configured start. Returns the best
  // attempt.
  AttemptPointer BestFrom(const InitialValues& initial) const {
    std::vector<InitialValues> elsewhere;
    if (!unknown_.empty()) {
      elsewhere = ArrangeUnknownRovers(checked_, rovers_, starts_, unknown_, agents_, initial, options_.stop_requested);
    }
    const bool is_warm =
        std::any_of(unknown_.begin(), unknown_.end(), [&](std::size_t i) { return HasWarmNode(rovers_[i], initial); });
    std::vector<AttemptPointer> attempts;
    const bool goes_on = initial.is_mostly_warm;
    attempts.push_back(Try(initial, goes_on ? SolveInitialValues::kLastSolution : SolveInitialValues::kOdometry,
                           goes_on && elsewhere.empty() ? options_.window_nodes : 0));
    std::size_t best = 0;
    for (const InitialValues& initial_values : elsewhere) {
      if (IsStopped()) break;
      attempts.push_back(Try(initial_values, SolveInitialValues::kArrangedRovers, /*window_nodes=*/0));
      // If the last solution has placed a rover without a configured start, accept another place only if that place is
      // clearly better.
      const double margin = best == 0 && is_warm && attempts[0]->staged.is_accepted ? options_.ambiguous_cost : 0;
      if (IsBetter(*attempts.back(), *attempts[best], margin)) best = attempts.size() - 1;
    }
    std::set<AgentId> ambiguous;
    for (const AttemptPointer& attempt : attempts) {
      const bool is_near = attempt->robust_cost - attempts[best]->robust_cost < options_.ambiguous_cost;
      if (!attempt->staged.is_accepted || !is_near) continue;
      ambiguous.merge(FindApart(checked_, attempt->staged.state, attempts[best]->staged.state));
    }
    attempts[best]->ambiguous = std::move(ambiguous);
    return std::move(attempts[best]);
  }

  static bool IsBetter(const Attempt& a, const Attempt& b, double margin) {
    return a.staged.is_accepted && a.robust_cost < b.robust_cost - margin;
  }

  // Returns true if the attempt was not accepted, or if it rejects most ranges of a rover.
  bool IsSuspect(const Attempt& attempt) const {
    if (!attempt.staged.is_accepted) return true;
    return attempt.options.window_nodes == 0 && HasMostlyRejected(checked_, attempt.staged.is_inlier);
  }

  AttemptPointer Try(const InitialValues& initial, SolveInitialValues initial_values, std::size_t window_nodes) const {
    auto attempt = std::make_unique<Attempt>();
    attempt->initial_values = initial_values;
    attempt->initial = initial;
    attempt->starts = StartsAt(initial);
    attempt->options = options_;
    attempt->options.window_nodes = window_nodes;
    attempt->terms = MakeTerms(*attempt, attempt->options);
    const CostTerms& terms = *attempt->terms;
    std::optional<FirstVerdicts> first;
    if (initial_values == SolveInitialValues::kLastSolution) {
      first = FindFirstVerdicts(checked_, initial, terms.RangeResiduals(terms.initial()), last_, options_);
    }
    attempt->staged = SolveInStages(terms, checked_, first, attempt->options);
    const bool is_accepted = attempt->staged.is_accepted;
    const double cost = terms.RobustCost(is_accepted ? attempt->staged.state : terms.initial());
    if (std::isfinite(cost)) attempt->robust_cost = cost;
    return attempt;
  }

  std::unique_ptr<CostTerms> MakeTerms(const Attempt& attempt, const SolverOptions& options) const {
    return std::make_unique<CostTerms>(checked_, rovers_, attempt.starts, agents_, attempt.initial,
                                       FindFree(checked_, rovers_, attempt.initial, options.window_nodes), options);
  }

  // Returns the start priors of all rovers. The prior of a rover without a configured start is the rover's initial
  // pose, with sigmas so large that the prior costs nothing.
  std::vector<StartPrior> StartsAt(const InitialValues& initial) const {
    std::vector<StartPrior> starts = starts_;
    for (const std::size_t i : unknown_) {
      starts[i].map_from_node = initial.poses[rovers_[i].first];
      starts[i].sigma_m = kFreeSigma_m;
      starts[i].sigma_rad = kFreeSigma_rad;
    }
    return starts;
  }

  void Take(Attempt& attempt) {
    StagedResult& staged = attempt.staged;
    solution_.is_accepted = staged.is_accepted;
    solution_.initial_values = attempt.initial_values;
    solution_.text = staged.text;
    solution_.initial_cost = staged.initial_cost;
    solution_.final_cost = staged.final_cost;
    solution_.iterations = staged.iterations;
    if (!staged.is_accepted) return TakePoses([this](std::size_t node) { return initial_.poses[node]; });
    if (initial_.has_warm && attempt.options.window_nodes == 0) {
      staged.state =
          KeepStill(checked_, rovers_, *attempt.terms, staged.is_inlier, last_, options_, std::move(staged.state));
      solution_.final_cost = attempt.terms->Cost(staged.is_inlier, staged.state);
    }
    TakePoses([&staged](std::size_t node) { return FromBlock(staged.state.poses[node]); });
    solution_.ranges = FindVerdicts(checked_, *attempt.terms, staged, /*is_all=*/false);
    solution_.rejected_range_count = static_cast<std::size_t>(std::count_if(
        solution_.ranges.begin(), solution_.ranges.end(), [](const auto& range) { return !range.is_inlier; }));
    const std::vector<double> scales(staged.state.numbers.begin(),
                                     staged.state.numbers.begin() + static_cast<std::ptrdiff_t>(rovers_.size()));
    solution_.rovers =
        JudgeRovers(checked_, rovers_, starts_, FindVerdicts(checked_, *attempt.terms, staged, /*is_all=*/true), scales,
                    attempt.ambiguous);
    TakeCovariances(attempt);
  }

  // Returns true if the graph determines the node's place in the map. Otherwise a covariance in the map is meaningless.
  bool IsInMap(std::size_t node) const {
    const AgentId agent = checked_.nodes[node].key.agent;
    return std::any_of(solution_.rovers.begin(), solution_.rovers.end(), [agent](const RoverResult& rover) {
      return rover.agent == agent && rover.anchoring != Anchoring::kUnanchored &&
             rover.anchoring != Anchoring::kYawFree;
    });
  }

  // Computes covariances with all nodes variable, even for a window: a window holds nodes constant only to save time.
  void TakeCovariances(const Attempt& attempt) {
    std::vector<std::size_t> nodes;
    for (const NodeKey& key : options_.covariance_of) {
      const std::optional<std::size_t> node = checked_.Find(key);
      if (node && IsInMap(*node)) nodes.push_back(*node);
    }
    if (nodes.empty()) return;
    SolverOptions full = options_;
    full.window_nodes = 0;
    const std::vector<Matrix6d> found =
        MakeTerms(attempt, full)->Covariances(attempt.staged.is_inlier, nodes, attempt.staged.state);
    for (std::size_t i = 0; i < found.size(); ++i) solution_.covariances[checked_.nodes[nodes[i]].key] = found[i];
  }

  template <typename PoseOf>
  void TakePoses(const PoseOf& pose_of) {
    for (std::size_t node = 0; node < checked_.nodes.size(); ++node) {
      solution_.poses.emplace(checked_.nodes[node].key, pose_of(node));
    }
  }

  const AgentFactsMap& agents_;
  const LastSolution& last_;
  const SolverOptions& options_;
  const CheckedGraph checked_;
  std::vector<Rover> rovers_;
  std::vector<StartPrior> starts_;
  // Indices in rovers_ of the rovers that have no configured start and have ranges to other agents.
  std::vector<std::size_t> unknown_;
  InitialValues initial_;
  Solution solution_;
};

}  // namespace

std::string ToString(SolveInitialValues initial_values) {
  switch (initial_values) {
    case SolveInitialValues::kOdometry:
      return "odometry";
    case SolveInitialValues::kLastSolution:
      return "warm";
    case SolveInitialValues::kArrangedRovers:
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
