#include "actors/pgo/standalone_solver.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

#include "actors/pgo/arrangement.h"
#include "actors/pgo/chordal.h"
#include "actors/pgo/standalone_shapes.h"

namespace moondb {

namespace {

// Some starts solve only the earliest poses first (a prefix of all poses in order of time). These are the initial
// lengths of the prefix, as fractions of all poses. 1: the whole graph is solved at once.
constexpr double kFirstPrefixes[] = {1, 0.25, 0.0625, 0.015625};
// A prefix grows by this factor from solve to solve. If the graph has priors, one start grows gently: priors determine
// every prefix, and few new poses lie near their solution.
constexpr double kGrowth = 2;
constexpr double kGentleGrowth = 1.1;
constexpr double kSameCostPart = 1e-7;
// An arrangement is worse than the best one if its cost exceeds this factor times the best cost.
constexpr double kWorseTimes = 1.5;
constexpr int kParallelStartsMax = 60;
constexpr std::size_t kShapesMax = 8;  // Maximum number of distinct shapes to keep.

bool IsSame(double a, double b) {
  return std::isfinite(b) && std::abs(a - b) <= kSameCostPart * std::max(a, b) + 1e-12;
}

struct Start {
  PlainFit fit;
  PlainState state;
};

// A solution of the first poses (a prefix of all poses) from which some start has continued. Other starts that reach it
// stop. `part`: length of the prefix, as a fraction of all poses.
struct Passed {
  double part = 0;
  double cost = 0;
  PlainState state;
};

class StandaloneSolver {
 public:
  StandaloneSolver(const StandaloneGraph& graph, const PlainOptions& options)
      : graph_(graph),
        options_(options),
        cost_(graph, options),
        all_(graph.nodes.size(), true),
        joined_(FindJoined(graph)) {
    solution_.cost = std::numeric_limits<double>::infinity();
    for (const PlainNode& node : graph.nodes) {
      if (!node.is_point) times_.push_back(node.time);
    }
    std::sort(times_.begin(), times_.end());
  }

  PlainSolution Run() {
    if (graph_.nodes.empty()) {
      solution_.has_converged = true;
      solution_.cost = 0;
      solution_.text = "the graph has no node: give a file with vertices";
      return std::move(solution_);
    }
    if (graph_.ranges.empty()) {
      SolveLoops();
    } else {
      const bool has_priors = std::any_of(graph_.nodes.begin(), graph_.nodes.end(),
                                          [](const PlainNode& node) { return node.key == kOriginKey; });
      if (has_priors) RunStarts(*std::rbegin(kFirstPrefixes), kGentleGrowth);
      for (const double first : kFirstPrefixes) {
        if (IsStopped() || (solution_.starts_at_lowest > 1 && first < kFirstPrefixes[0])) break;
        RunStarts(first, kGrowth);
      }
      if (solution_.starts_at_lowest < 2 && !best_.empty()) SearchBeside();
    }
    if (!solution_.has_converged && !IsStopped()) Polish();
    return Finish();
  }

  PlainSolution RunFromOdometry() {
    GoFromOdometry();
    return Finish();
  }

  PlainSolution RunFromVertices() {
    if (graph_.nodes.empty()) return Run();
    PlainState state;
    for (const PlainNode& node : graph_.nodes) state.push_back(ToBlock(node.vertex));
    const PlainFit fit = cost_.Minimise(all_, StartQuality::kRough, state);
    Add(Start{fit, std::move(state)}, PlainInitialValues::kVertices);
    if (!solution_.has_converged && !IsStopped()) Polish();
    return Finish();
  }

 private:
  bool IsStopped() const { return options_.stop_requested && options_.stop_requested(); }

  void SolveLoops() {
    const std::vector<std::size_t> heads = FindHeads(graph_, all_);
    const bool has_loops = HasLoops(graph_, all_, heads);
    PlainState state = ChordalParts(graph_, all_, heads);
    MoveToFixed(heads, state);
    const PlainFit fit = cost_.Minimise(all_, StartQuality::kNear, state);
    Add(Start{fit, std::move(state)}, has_loops ? PlainInitialValues::kChordal : PlainInitialValues::kOdometry);
    if (!fit.has_converged && has_loops && !IsStopped()) GoFromOdometry();
  }

  void GoFromOdometry() {
    std::vector<bool> placed(graph_.nodes.size(), false);
    PlainState state(graph_.nodes.size(), ToBlock(Pose{}));
    const std::vector<std::size_t> heads = FindHeads(graph_, all_);
    for (std::size_t node = 0; node < heads.size(); ++node) placed[node] = heads[node] == node;
    // Compose along each agent's trajectory first. Use other edges only for nodes that the trajectories do not reach.
    ComposeFromPlaced(graph_, all_, ComposeAlong::kWay, placed, state);
    ComposeFromPlaced(graph_, all_, ComposeAlong::kAll, placed, state);
    MoveToFixed(heads, state);
    const PlainFit fit = cost_.Minimise(all_, StartQuality::kRough, state);
    Add(Start{fit, std::move(state)}, PlainInitialValues::kOdometry);
  }

  // Moves each part rigidly so that the first fixed node of the part is at its vertex. Then sets every fixed node to
  // its vertex.
  void MoveToFixed(const std::vector<std::size_t>& heads, PlainState& state) const {
    std::map<std::size_t, Pose> map_from_part;
    for (std::size_t node = 0; node < state.size(); ++node) {
      const PlainNode& fixed = graph_.nodes[node];
      if (fixed.is_fixed) map_from_part.try_emplace(heads[node], fixed.vertex * FromBlock(state[node]).Inverse());
    }
    for (std::size_t node = 0; node < state.size(); ++node) {
      const auto moved = map_from_part.find(heads[node]);
      if (moved != map_from_part.end()) state[node] = ToBlock(moved->second * FromBlock(state[node]));
      if (graph_.nodes[node].is_fixed) state[node] = ToBlock(graph_.nodes[node].vertex);
    }
  }

  // Returns one flag per node: true for the first fraction `part` of the poses by time, for the points that these poses
  // observe, and for fixed nodes.
  ActiveNodes Prefix(double part) const {
    if (times_.empty()) return all_;  // The graph has only points.
    const auto last = static_cast<std::size_t>(part * static_cast<double>(times_.size() - 1));
    ActiveNodes active(graph_.nodes.size(), false);
    for (std::size_t node = 0; node < active.size(); ++node) {
      active[node] = part >= 1 || graph_.nodes[node].is_fixed ||
                     (!graph_.nodes[node].is_point && graph_.nodes[node].time <= times_[last]);
    }
    const auto show = [&](std::size_t pose, std::size_t point) {
      if (graph_.nodes[point].is_point && !graph_.nodes[pose].is_point && active[pose]) active[point] = true;
    };
    const auto see = [&](const auto& edge) {
      show(edge.from, edge.to);
      show(edge.to, edge.from);
    };
    for (const PlainSighting& sighting : graph_.sightings) see(sighting);
    for (const PlainRange& range : graph_.ranges) see(range);
    return active;
  }

  // Places each part of the lowest-cost solution elsewhere in turn, while the other parts stay in place. This helps,
  // for example, if a landmark tied only by ranges is on the wrong side of the trajectory.
  void SearchBeside() {
    const std::vector<std::size_t> heads = FindHeads(graph_, all_);
    const std::vector<bool> standing = FirstPlaced(all_, heads);
    int left = kParallelStartsMax;
    for (std::size_t head = 0; head < heads.size() && left > 0 && !IsStopped(); ++head) {
      if (heads[head] != head || standing[head]) continue;
      std::vector<bool> placed(heads.size());
      for (std::size_t node = 0; node < heads.size(); ++node) placed[node] = heads[node] != head;
      const PlainState from = best_;
      for (Arrangement& arrangement : ArrangeParts(graph_, all_, placed, heads, from, Freedom())) {
        if (--left < 0 || IsStopped()) break;
        const double before = solution_.cost;
        Add(RunStart(1, kGrowth, all_, std::move(arrangement.state)), solution_.initial_values);
        // If this start has replaced the solution, stop: the remaining arrangements belong to the previous solution.
        if (solution_.cost < before) break;
      }
    }
  }

  // Continues from the best solution if it has not converged, with more iterations and, for spatial graphs, with
  // dogleg. In a shallow valley Levenberg-Marquardt can need hundreds of steps.
  void Polish() {
    if (best_.empty()) return;
    PlainState state = best_;
    const PlainFit fit = cost_.Minimise(all_, StartQuality::kShallow, state);
    Add(Start{fit, std::move(state)}, solution_.initial_values);
  }

  // Returns one flag per node: true if the node stays in place while other parts are arranged. Parts with a fixed node
  // stay in place; if no node is fixed, the largest part does.
  std::vector<bool> FirstPlaced(const ActiveNodes& active, const std::vector<std::size_t>& heads) const {
    std::map<std::size_t, std::size_t> sizes;
    std::set<std::size_t> standing;
    for (std::size_t node = 0; node < heads.size(); ++node) {
      if (!active[node]) continue;
      ++sizes[heads[node]];
      if (graph_.nodes[node].is_fixed) standing.insert(heads[node]);
    }
    if (standing.empty() && !sizes.empty()) {
      const auto is_smaller = [](const auto& a, const auto& b) { return a.second < b.second; };
      standing.insert(std::max_element(sizes.begin(), sizes.end(), is_smaller)->first);
    }
    std::vector<bool> placed(heads.size(), false);
    for (std::size_t node = 0; node < heads.size(); ++node)
      placed[node] = active[node] && standing.contains(heads[node]);
    return placed;
  }

  // `first`: the first prefix, as a fraction of all poses. `growth`: factor by which it grows.
  void RunStarts(double first, double growth) {
    const ActiveNodes active = Prefix(first);
    const std::vector<std::size_t> heads = FindHeads(graph_, active);
    PlainState state = ChordalParts(graph_, active, heads);
    MoveToFixed(heads, state);
    const std::vector<bool> placed = FirstPlaced(active, heads);
    const bool is_whole = placed == active;
    PlainInitialValues initial_values =
        is_whole ? (HasLoops(graph_, active, heads) ? PlainInitialValues::kChordal : PlainInitialValues::kOdometry)
                 : PlainInitialValues::kArrangedParts;
    if (first < 1) initial_values = PlainInitialValues::kPrefixGrowth;
    std::vector<Arrangement> arrangements = ArrangeParts(graph_, active, placed, heads, state, Freedom());
    for (Arrangement& arrangement : arrangements) {
      if (IsStopped()) return;
      const bool is_worse = arrangement.cost > kWorseTimes * arrangements.front().cost;
      if (solution_.starts_at_lowest > 1 && is_worse) return;
      Add(RunStart(first, growth, active, std::move(arrangement.state)), initial_values);
    }
  }

  ArrangementOptions Freedom() const {
    ArrangementOptions options;
    if (graph_.is_planar) options.freedom = BodyFreedom::kPlanar;
    options.stop_requested = options_.stop_requested;
    return options;
  }

  // Runs one start to its end. `part`: fraction of all poses, in order of time, that the start solves first. If an
  // earlier start had the same solution for the same fraction of the poses, this start stops and returns infinite cost,
  // because it would only repeat the earlier start.
  Start RunStart(double part, double growth, ActiveNodes active, PlainState state) {
    PlainFit fit = cost_.Minimise(active, StartQuality::kRough, state);
    int iterations = fit.iterations;
    while (part < 1 && !IsStopped()) {
      if (HasPassed(part, fit.cost, state))
        return Start{{false, std::numeric_limits<double>::infinity(), iterations}, {}};
      passed_.push_back({part, fit.cost, state});
      part = std::min(1.0, growth * part);
      const ActiveNodes grown = Prefix(part);
      Extend(active, grown, state);
      active = grown;
      fit = cost_.Minimise(active, StartQuality::kRough, state);
      iterations += fit.iterations;
    }
    fit.iterations = iterations;
    return Start{fit, std::move(state)};
  }

  bool HasPassed(double part, double cost, const PlainState& state) const {
    return std::any_of(passed_.begin(), passed_.end(), [&](const Passed& passed) {
      const bool is_there = passed.part == part && IsSame(cost, passed.cost);
      return is_there && HaveSameShape(graph_, joined_, state, passed.state);
    });
  }

  // Places the nodes whose flag is true in `active` but not in `before`: by composing edges from placed nodes, or by
  // arranging new parts around the placed nodes.
  void Extend(const ActiveNodes& before, const ActiveNodes& active, PlainState& state) const {
    std::vector<bool> placed = before;
    ComposeFromPlaced(graph_, active, ComposeAlong::kAll, placed, state);
    if (placed == active) return;
    ActiveNodes fresh(active.size(), false);
    for (std::size_t node = 0; node < active.size(); ++node) fresh[node] = active[node] && !placed[node];
    const std::vector<std::size_t> heads = FindHeads(graph_, fresh);
    const PlainState parts = ChordalParts(graph_, fresh, heads);
    for (std::size_t node = 0; node < active.size(); ++node) {
      if (fresh[node]) state[node] = parts[node];
    }
    ArrangementOptions one = Freedom();
    one.kept = 1;
    state = std::move(ArrangeParts(graph_, active, placed, heads, state, one).front().state);
  }

  void Add(Start start, PlainInitialValues initial_values) {
    ++solution_.starts;
    solution_.iterations += start.fit.iterations;
    if (!std::isfinite(start.fit.cost)) return;
    const bool is_same = IsSame(start.fit.cost, solution_.cost);
    if (is_same) {
      Meet(start.state);
    } else if (start.fit.cost < solution_.cost) {
      lowest_ = {start.state};
      solution_.starts_at_lowest = 1;
      solution_.initial_values = initial_values;
    }
    const bool is_arrival = is_same && start.fit.has_converged && !solution_.has_converged;
    if (start.fit.cost >= solution_.cost && !is_arrival) return;
    solution_.cost = start.fit.cost;
    solution_.has_converged = start.fit.has_converged;
    best_ = std::move(start.state);
  }

  // Counts this start in starts_at_lowest if it ends in the same shape as an earlier start of the same cost. Mirrored
  // shapes can have equal cost.
  void Meet(const PlainState& state) {
    const auto is_same = [&](const PlainState& other) { return HaveSameShape(graph_, joined_, state, other); };
    if (std::any_of(lowest_.begin(), lowest_.end(), is_same)) {
      ++solution_.starts_at_lowest;
    } else if (lowest_.size() < kShapesMax) {
      lowest_.push_back(state);
    }
  }

  PlainSolution Finish() {
    // If no start gave a solution, return the file's vertices.
    for (const PlainNode& node : graph_.nodes) solution_.poses.push_back(node.vertex);
    for (std::size_t node = 0; node < best_.size(); ++node) solution_.poses[node] = FromBlock(best_[node]);
    const auto say = [this](const std::string& line) { solution_.text += (solution_.text.empty() ? "" : "; ") + line; };
    if (!solution_.has_converged) say(IsStopped() ? "stopped" : "did not converge");
    const std::size_t parts = CountLooseParts(graph_, joined_);
    if (parts > 1) {
      say(std::to_string(parts) + " parts that no edge joins: their poses relative to each other are unknown");
    }
    if (lowest_.size() > 1) say("ambiguous: another solution fits as well");
    return std::move(solution_);
  }

  const StandaloneGraph& graph_;
  const PlainOptions& options_;
  StandaloneCost cost_;
  const ActiveNodes all_;
  const std::vector<std::size_t> joined_;  // Result of FindJoined.
  std::vector<std::int64_t> times_;
  std::vector<Passed> passed_;
  PlainState best_;
  std::vector<PlainState> lowest_;  // Up to kShapesMax lowest-cost states of different shapes.
  PlainSolution solution_;
};

}  // namespace

std::string ToString(PlainInitialValues initial_values) {
  switch (initial_values) {
    case PlainInitialValues::kOdometry:
      return "odometry";
    case PlainInitialValues::kChordal:
      return "chordal";
    case PlainInitialValues::kArrangedParts:
      return "stage 0";
    case PlainInitialValues::kPrefixGrowth:
      return "prefix growth";
    case PlainInitialValues::kVertices:
      return "vertices";
  }
  return "unknown";
}

PlainSolution SolveStandaloneGraph(const StandaloneGraph& graph, const PlainOptions& options) {
  return StandaloneSolver(graph, options).Run();
}

PlainSolution SolveFromOdometry(const StandaloneGraph& graph, const PlainOptions& options) {
  return StandaloneSolver(graph, options).RunFromOdometry();
}

PlainSolution SolveFromVertices(const StandaloneGraph& graph, const PlainOptions& options) {
  return StandaloneSolver(graph, options).RunFromVertices();
}

}  // namespace moondb
