#include "actors/pgo/pose_graph_solver.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/initial_values.h"

namespace moondb {

namespace {

constexpr int kTestsMax = 10;  // Of the ranges; two or three are usual.
// A rejected range comes back a little later than it went, lest tests say one thing and the other in turn.
constexpr double kReturnPart = 0.9;
// From this share of known nodes on, the last verdicts are worth more than a robust stage.
constexpr double kWarmShare = 0.8;
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
  if (part_count > 1) say("its odometry is interrupted in " + std::to_string(part_count - 1) + " places");
  if (const auto found = graph.left_out.find(rover.agent); found != graph.left_out.end()) {
    say(std::to_string(found->second.count) + " records left out, first: " + found->second.first);
  }
  return text;
}

std::vector<RoverResult> JudgeRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                     const std::vector<StartPrior>& starts, const std::vector<RangeVerdict>& ranges,
                                     const std::vector<double>& scales) {
  std::map<AgentId, std::size_t> accepted;
  for (const RangeVerdict& range : ranges) {
    if (!range.is_inlier) continue;
    ++accepted[range.from.agent];
    ++accepted[range.to.agent];
  }
  std::set<AgentId> anchors;
  for (const CheckedNode& node : graph.nodes) {
    if (node.is_fixed) anchors.insert(node.key.agent);
  }
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    if (starts[i].is_configured) anchors.insert(rovers[i].agent);
  }
  const std::set<AgentId> anchored = FindAnchored(ranges, anchors);

  std::vector<RoverResult> results;
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    RoverResult result;
    result.agent = rovers[i].agent;
    result.odometry_scale = 1 + scales[i];
    result.node_count = rovers[i].count;
    result.range_count = accepted[result.agent];
    if (anchored.contains(result.agent)) {
      result.anchoring = result.range_count > 0 ? Anchoring::kAnchored : Anchoring::kNoRanges;
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

}  // namespace

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
  const CheckedGraph checked = CheckGraph(graph, agents);
  const std::vector<Rover> rovers = FindRovers(checked);
  Solution solution;
  solution.left_out = checked.left_out;
  solution.node_count = checked.nodes.size();
  solution.odometry_count = checked.odometry.size();
  solution.range_count = checked.ranges.size();

  std::vector<StartPrior> starts;
  const LoosePrior loose{options.loose_sigma_m, options.loose_sigma_rad};
  for (const Rover& rover : rovers) starts.push_back(FindStartPrior(checked.nodes[rover.first], agents, loose));
  InitialValues initial = FindInitialValues(checked, rovers, starts, last.poses);
  const bool is_warm =
      static_cast<double>(initial.warm_count) >= kWarmShare * static_cast<double>(checked.nodes.size());
  if (is_warm) initial.biases_m = EstimateWarmBiases(checked, agents, initial, last, options);

  std::vector<double> scales = initial.scales;
  std::vector<Pose> poses = initial.poses;
  if (rovers.empty()) {
    solution.is_accepted = true;
    solution.text = "no rover has a node yet";
  } else {
    const CostTerms terms(checked, rovers, starts, agents, initial, FindFree(checked, rovers, options.window_nodes),
                          options);
    std::optional<std::vector<bool>> first_inliers;
    if (is_warm) {
      first_inliers = FindFirstInliers(checked, initial, terms.RangeResiduals(terms.initial()), last, options);
    }
    const StagedResult staged = SolveInStages(terms, checked, first_inliers, options);
    solution.is_accepted = staged.is_accepted;
    solution.text = staged.text;
    solution.initial_cost = staged.initial_cost;
    solution.final_cost = staged.final_cost;
    solution.iterations = staged.iterations;
    if (staged.is_accepted) {
      for (std::size_t node = 0; node < poses.size(); ++node) poses[node] = FromBlock(staged.state.poses[node]);
      std::copy_n(staged.state.numbers.begin(), scales.size(), scales.begin());
      solution.ranges = JudgeRanges(checked, terms, staged);
    }
  }
  solution.rovers = JudgeRovers(checked, rovers, starts, solution.ranges, scales);
  solution.rejected_range_count = static_cast<std::size_t>(std::count_if(
      solution.ranges.begin(), solution.ranges.end(), [](const auto& range) { return !range.is_inlier; }));
  for (std::size_t node = 0; node < poses.size(); ++node) solution.poses.emplace(checked.nodes[node].key, poses[node]);
  return solution;
}

}  // namespace moondb
