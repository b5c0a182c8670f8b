#include "actors/pgo/pose_graph_solver.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/initial_values.h"
#include "actors/pgo/unknown_starts.h"

namespace moondb {

namespace {

constexpr int kTestsMax = 10;  // Of the ranges; two or three are usual.
// A rejected range comes back a little later than it went, lest tests say one thing and the other in turn.
constexpr double kReturnPart = 0.9;
// From this share of known nodes on, the last verdicts are worth more than a robust stage.
constexpr double kWarmShare = 0.8;
// Of a start that nobody knows: far beyond any mission, so that it costs nothing.
constexpr double kFreeSigmaM = 1e4;
constexpr double kFreeSigmaRad = 100;
constexpr double kApartM = 1;                   // Places nearer than this count as one.
constexpr double kNewRangeSlack = 2;            // A new node's first guess is odometry's.
constexpr std::size_t kAnchoringRangesMin = 3;  // Fewer leave more than one place to stand.

// Costs are sums of squares; below this part of them is rounding.
bool IsHigher(double cost, double reference) { return cost > reference * (1 + 1e-6) + 1e-9; }

// The ranges of each pair of agents, in order of time.
std::vector<std::vector<std::size_t>> FindSeries(const CheckedGraph& graph) {
  std::map<std::pair<AgentId, AgentId>, std::vector<std::size_t>> series;
  for (std::size_t i = 0; i < graph.ranges.size(); ++i) {
    const RangeEdge& edge = *graph.ranges[i].edge;
    series[std::minmax(edge.from.agent, edge.to.agent)].push_back(i);
  }
  std::vector<std::vector<std::size_t>> result;
  for (auto& [pair, ranges] : series) {
    std::stable_sort(ranges.begin(), ranges.end(), [&graph](std::size_t a, std::size_t b) {
      return graph.ranges[a].edge->stamp_ns < graph.ranges[b].edge->stamp_ns;
    });
    result.push_back(std::move(ranges));
  }
  return result;
}

// What blocks a line of sight does so for a while: beside a rejected range of the same pair, one that errs the same way
// needs less to be doubted.
void ExtendBursts(const std::vector<std::size_t>& series, const std::vector<double>& residuals,
                  const std::vector<double>& limits, std::vector<bool>& is_inlier) {
  const auto extend = [&](std::size_t from, std::size_t to) {
    const bool is_same_way = residuals[from] * residuals[to] > 0;
    if (!is_inlier[from] && is_same_way && std::abs(residuals[to]) > limits[to]) is_inlier[to] = false;
  };
  for (std::size_t i = 1; i < series.size(); ++i) extend(series[i - 1], series[i]);
  for (std::size_t i = series.size(); i-- > 1;) extend(series[i], series[i - 1]);
}

// `before`: what the last test said. A range that has no part in the solve keeps it.
std::vector<bool> FindInliers(const CheckedGraph& graph, const CostTerms& terms, const std::vector<double>& residuals,
                              const std::vector<bool>& before, const SolverOptions& options) {
  std::vector<bool> is_inlier(residuals.size());
  std::vector<double> burst_limits(residuals.size());
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const double part = before[i] ? 1 : kReturnPart;
    is_inlier[i] = terms.HasRange(i) ? std::abs(residuals[i]) <= part * options.reject_sigmas : before[i];
    burst_limits[i] = part * options.burst_sigmas;
  }
  for (const std::vector<std::size_t>& series : FindSeries(graph)) {
    ExtendBursts(series, residuals, burst_limits, is_inlier);
  }
  return is_inlier;
}

// The last verdicts; of ranges with a new node, and where there was no last solution, whether it fits its first guess.
std::vector<bool> FindFirstInliers(const CheckedGraph& graph, const InitialValues& initial,
                                   const std::vector<double>& residuals, const LastSolution& last,
                                   const SolverOptions& options) {
  std::vector<bool> is_inlier(residuals.size());
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const CheckedRange& range = graph.ranges[i];
    const bool is_old = (initial.is_warm[range.from] || graph.nodes[range.from].is_fixed) &&
                        (initial.is_warm[range.to] || graph.nodes[range.to].is_fixed);
    is_inlier[i] = is_old ? !last.rejected.contains({range.edge->from, range.edge->to})
                          : std::abs(residuals[i]) <= kNewRangeSlack * options.reject_sigmas;
  }
  return is_inlier;
}

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

// Which rovers accepted ranges join with the map.
std::set<AgentId> FindAnchored(const std::vector<RangeVerdict>& ranges, std::set<AgentId> anchored) {
  for (bool has_grown = true; has_grown;) {
    has_grown = false;
    std::map<AgentId, std::size_t> ranges_to_anchored;
    for (const RangeVerdict& range : ranges) {
      if (!range.is_inlier || anchored.contains(range.from.agent) == anchored.contains(range.to.agent)) continue;
      const AgentId agent = anchored.contains(range.from.agent) ? range.to.agent : range.from.agent;
      ++ranges_to_anchored[agent];
    }
    for (const auto& [agent, count] : ranges_to_anchored) {
      if (count >= kAnchoringRangesMin) has_grown |= anchored.insert(agent).second;
    }
  }
  return anchored;
}

std::string TextOf(const CheckedGraph& graph, const RoverResult& rover, const StartPrior& start,
                   std::size_t part_count) {
  std::string text;
  const auto say = [&text](const std::string& line) { text += (text.empty() ? "" : "; ") + line; };
  if (!start.is_configured) say("no start pose configured for its first node: begins at its raw pose");
  if (rover.anchoring == Anchoring::kNoRanges) say("no accepted range: start pose and odometry alone");
  if (rover.anchoring == Anchoring::kUnanchored) say("nothing ties it to the map");
  if (rover.anchoring == Anchoring::kYawFree) say("nothing says how it is turned about the base station");
  if (rover.anchoring == Anchoring::kAmbiguous) say("ambiguous: it would stand nearly as well elsewhere");
  if (part_count > 1) say("its odometry is interrupted in " + std::to_string(part_count - 1) + " places");
  if (const auto found = graph.left_out.find(rover.agent); found != graph.left_out.end()) {
    say(std::to_string(found->second.count) + " records left out, first: " + found->second.first);
  }
  return text;
}

// Fixed nodes hold a team's place; two apart from each other its yaw, too.
bool HoldFixedNodesYaw(const CheckedGraph& graph) {
  const CheckedNode* first = nullptr;
  for (const CheckedNode& node : graph.nodes) {
    if (!node.is_fixed) continue;
    if (first == nullptr) first = &node;
    if ((node.raw.position_m - first->raw.position_m).head<2>().norm() > kApartM) return true;
  }
  return false;
}

struct RoversInMap {
  std::set<AgentId> anchored;
  std::set<AgentId> yaw_free;
};

RoversInMap FindInMap(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                      const std::vector<StartPrior>& starts, const std::vector<RangeVerdict>& ranges) {
  std::set<AgentId> fixed;
  std::set<AgentId> configured;
  for (const CheckedNode& node : graph.nodes) {
    if (node.is_fixed) fixed.insert(node.key.agent);
  }
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    if (starts[i].is_configured) configured.insert(rovers[i].agent);
  }
  RoversInMap result;
  if (HoldFixedNodesYaw(graph)) configured.insert(fixed.begin(), fixed.end());
  result.anchored = FindAnchored(ranges, configured);
  result.yaw_free = FindAnchored(ranges, fixed);
  return result;
}

std::vector<RoverResult> JudgeRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                     const std::vector<StartPrior>& starts, const std::vector<RangeVerdict>& ranges,
                                     const std::vector<double>& scales, const std::set<AgentId>& ambiguous) {
  std::map<AgentId, std::size_t> accepted;
  for (const RangeVerdict& range : ranges) {
    if (!range.is_inlier) continue;
    ++accepted[range.from.agent];
    ++accepted[range.to.agent];
  }
  const RoversInMap in_map = FindInMap(graph, rovers, starts, ranges);
  std::vector<RoverResult> results;
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    RoverResult result;
    result.agent = rovers[i].agent;
    result.odometry_scale = 1 + scales[i];
    result.node_count = rovers[i].count;
    result.range_count = accepted[result.agent];
    if (in_map.anchored.contains(result.agent)) {
      result.anchoring = result.range_count > 0 ? Anchoring::kAnchored : Anchoring::kNoRanges;
      if (ambiguous.contains(result.agent)) result.anchoring = Anchoring::kAmbiguous;
    } else if (in_map.yaw_free.contains(result.agent)) {
      result.anchoring = Anchoring::kYawFree;
    }
    result.text = TextOf(graph, result, starts[i], rovers[i].part_heads.size());
    results.push_back(std::move(result));
  }
  return results;
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
