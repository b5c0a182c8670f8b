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
#include "actors/pgo/outlier_tests.h"
#include "actors/pgo/placement_by_poses.h"
#include "actors/pgo/rover_status.h"
#include "actors/pgo/set_test.h"
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
                     !last.rejected.contains(KeyOf(*range.edge)));
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

// Returns the verdicts on the factors that took part in the solve, or on all factors if `is_all`. A factor that did not
// take part keeps its previous verdict.
std::vector<FactorVerdict> FindVerdicts(const CheckedGraph& graph, const CostTerms& terms, const StagedResult& staged,
                                        bool is_all) {
  const std::vector<double> residuals = terms.TestedResiduals(staged.state);
  std::vector<FactorVerdict> verdicts;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    if (!is_all && !terms.HasTested(i)) continue;
    verdicts.push_back({graph.KeyOfTested(i), staged.is_inlier[i], residuals[i]});
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
  std::map<AgentId, std::string> not_placed;  // PosePlacement::not_placed.
  std::vector<bool> is_allowed;               // One flag per tested factor.
  SolverOptions options;                      // The caller's options, with window_nodes of this attempt.
  std::unique_ptr<CostTerms> terms;
  StagedResult staged;
  std::vector<FactorSet> refused;
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
    to_place_ = FindRoversToPlace(checked_, rovers_, starts_);
    initial_ = FindInitialValues(checked_, rovers_, starts_, last.poses);
    if (initial_.is_mostly_warm) initial_.biases_m = EstimateWarmBiases(checked_, agents, initial_, last, options);
  }

  Solution Run() {
    solution_.left_out = checked_.left_out;
    solution_.node_count = checked_.nodes.size();
    solution_.odometry_count = checked_.odometry.size();
    for (std::size_t i = 0; i < checked_.tested_count(); ++i) ++solution_.counts[checked_.KeyOfTested(i).kind].usable;
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

  // Places rovers by loop closures and priors, and solves from the result. If such a solution is suspect, also solves
  // without this placement.
  AttemptPointer BestFrom(const InitialValues& initial) const {
    if (to_place_.empty()) return BestArranged(initial, {});
    PosePlacement placement = PlaceByPoses(checked_, rovers_, starts_, to_place_, initial);
    AttemptPointer best = BestArranged(placement.initial, placement);
    if (placement.placed.empty() || IsStopped() || !IsSuspect(*best)) return best;
    placement.placed.clear();
    AttemptPointer other = BestArranged(initial, placement);
    return IsBetter(*other, *best, 0) ? std::move(other) : std::move(best);
  }

  // Solves from `initial`, and from each arrangement of the rovers that have neither a configured start nor a place in
  // `placement`. Returns the best attempt.
  AttemptPointer BestArranged(const InitialValues& initial, const PosePlacement& placement) const {
    std::vector<std::size_t> unknown = unknown_;
    std::erase_if(unknown, [&](std::size_t i) { return placement.placed.contains(rovers_[i].agent); });
    std::vector<StartPrior> starts = starts_;
    for (std::size_t i = 0; i < rovers_.size(); ++i) {
      if (placement.placed.contains(rovers_[i].agent)) starts[i].is_configured = true;
    }
    std::vector<InitialValues> elsewhere;
    if (!unknown.empty()) {
      elsewhere = ArrangeUnknownRovers(checked_, rovers_, starts, unknown, agents_, initial, options_.stop_requested);
    }
    const bool is_warm =
        std::any_of(unknown.begin(), unknown.end(), [&](std::size_t i) { return HasWarmNode(rovers_[i], initial); });
    std::vector<AttemptPointer> attempts;
    const bool goes_on = initial.is_mostly_warm;
    const SolveInitialValues first = goes_on                     ? SolveInitialValues::kLastSolution
                                     : !placement.placed.empty() ? SolveInitialValues::kArrangedRovers
                                                                 : SolveInitialValues::kOdometry;
    attempts.push_back(Try(initial, placement, first, goes_on && elsewhere.empty() ? options_.window_nodes : 0));
    std::size_t best = 0;
    for (const InitialValues& initial_values : elsewhere) {
      if (IsStopped()) break;
      attempts.push_back(Try(initial_values, placement, SolveInitialValues::kArrangedRovers, /*window_nodes=*/0));
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

  AttemptPointer Try(const InitialValues& initial, const PosePlacement& placement, SolveInitialValues initial_values,
                     std::size_t window_nodes) const {
    auto attempt = std::make_unique<Attempt>();
    attempt->initial_values = initial_values;
    attempt->initial = initial;
    attempt->not_placed = placement.not_placed;
    attempt->starts = StartsAt(initial, placement);
    attempt->is_allowed = FindAllowed(placement);
    attempt->options = options_;
    attempt->options.window_nodes = window_nodes;
    attempt->terms = MakeTerms(*attempt, attempt->options);
    const CostTerms& terms = *attempt->terms;
    std::optional<FirstVerdicts> first;
    if (initial_values == SolveInitialValues::kLastSolution) {
      first = FindFirstVerdicts(checked_, initial, terms.TestedResiduals(terms.initial()), last_, options_);
    }
    SetTested tested = SolveWithSetTest(terms, checked_, first, attempt->is_allowed, last_, attempt->options);
    attempt->staged = std::move(tested.staged);
    attempt->refused = std::move(tested.refused);
    const bool is_accepted = attempt->staged.is_accepted;
    const double cost = terms.RobustCost(attempt->is_allowed, is_accepted ? attempt->staged.state : terms.initial());
    if (std::isfinite(cost)) attempt->robust_cost = cost;
    return attempt;
  }

  std::unique_ptr<CostTerms> MakeTerms(const Attempt& attempt, const SolverOptions& options) const {
    return std::make_unique<CostTerms>(checked_, rovers_, attempt.starts, agents_, attempt.initial,
                                       FindFree(checked_, rovers_, attempt.initial, options.window_nodes), options);
  }

  // Returns one flag per tested factor. A loop closure between two rovers, of which one was not placed and has no
  // ranges, is not allowed: too few loop closures agree on the rover's place.
  std::vector<bool> FindAllowed(const PosePlacement& placement) const {
    std::set<AgentId> loose;
    for (const auto& [agent, why] : placement.not_placed) loose.insert(agent);
    for (const std::size_t i : unknown_) loose.erase(rovers_[i].agent);
    std::vector<bool> is_allowed(checked_.tested_count(), true);
    for (std::size_t i = checked_.first_closure(); i < checked_.first_prior(); ++i) {
      const FactorKey key = checked_.KeyOfTested(i);
      is_allowed[i] = loose.contains(key.from.agent) == loose.contains(key.to.agent);
    }
    return is_allowed;
  }

  // Returns the start priors of all rovers. The prior of a rover that ranges, loop closures or priors place is the
  // rover's initial pose, with sigmas so large that the prior costs nothing.
  std::vector<StartPrior> StartsAt(const InitialValues& initial, const PosePlacement& placement) const {
    std::vector<StartPrior> starts = starts_;
    std::vector<std::size_t> placed = unknown_;
    for (const std::size_t i : to_place_) {
      if (!placement.not_placed.contains(rovers_[i].agent)) placed.push_back(i);
    }
    for (const std::size_t i : placed) {
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
    solution_.verdicts = FindVerdicts(checked_, *attempt.terms, staged, /*is_all=*/false);
    for (const FactorVerdict& verdict : solution_.verdicts) {
      solution_.counts[verdict.factor.kind].rejected += !verdict.is_inlier;
    }
    solution_.refused = attempt.refused;
    const std::vector<double> scales(staged.state.numbers.begin(),
                                     staged.state.numbers.begin() + static_cast<std::ptrdiff_t>(rovers_.size()));
    solution_.rovers =
        JudgeRovers(checked_, rovers_, starts_, FindVerdicts(checked_, *attempt.terms, staged, /*is_all=*/true), scales,
                    attempt.ambiguous, attempt.not_placed);
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
  std::vector<std::size_t> to_place_;  // Result of FindRoversToPlace.
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

void LastSolution::AddVerdict(const FactorKey& factor, bool is_inlier) {
  if (!is_inlier) {
    rejected.insert(factor);
  } else if (factor.kind != FactorKind::kRange) {
    accepted.insert(factor);
  }
}

LastSolution ToLast(const Solution& solution) {
  LastSolution last;
  last.poses = solution.poses;
  for (const FactorVerdict& verdict : solution.verdicts) last.AddVerdict(verdict.factor, verdict.is_inlier);
  return last;
}

Solution SolvePoseGraph(const PoseGraph& graph, const AgentFactsMap& agents, const LastSolution& last,
                        const SolverOptions& options) {
  return Solver(graph, agents, last, options).Run();
}

}  // namespace moondb
