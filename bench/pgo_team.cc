#include "bench/pgo_team.h"

#include <algorithm>
#include <random>
#include <utility>

#include "tests/actors/pgo/scenario.h"

namespace moondb {
namespace {

using simulation::Scenario;
using simulation::ScenarioOptions;

constexpr int kRovers = 3;
constexpr int kNewNodes = 10;
constexpr int kUnknownStartsNodes = 200;  // Nodes per rover.
constexpr double kRight_m = 1;
constexpr std::size_t kWindowNodes = 100;
constexpr std::int64_t kStep_ns = 10'000'000'000;  // Time between two nodes of a scenario.

ScenarioOptions OptionsOf(const TeamCase& team, std::uint64_t seed) {
  ScenarioOptions options;
  options.seed = seed;
  options.rover_count = kRovers;
  options.node_count = (team.node_count - 1) / kRovers;
  options.step_m = 0.3;
  options.range_every = 5;
  options.outlier_ratio = team.outlier_ratio;
  options.outlier_min_m = team.outlier_min_m;
  options.bias_sigma_m = team.bias_sigma_m;
  options.correlation = team.correlation;
  options.is_around_base = true;
  options.start_sigma_m = 0.01;
  options.start_sigma_rad = 0.001;
  options.step_noise_m = team.has_low_drift ? 0.003 : 0.01;
  options.yaw_noise_rad = team.has_low_drift ? 0.0001 : 0.0002;
  options.tilt_noise_rad = team.has_low_drift ? 0.0002 : 0.0005;
  std::mt19937_64 rng(seed + 1000);
  std::normal_distribution<double> scale(0, team.has_low_drift ? 0.004 : 0.02);
  for (int i = 0; i < kRovers; ++i) options.scale_errors.push_back(scale(rng));
  return options;
}

// Returns the graph without the last kNewNodes nodes of each rover. `node_count` is the number of nodes per rover.
PoseGraph Earlier(const PoseGraph& graph, int node_count) {
  PoseGraph earlier = graph;
  const std::int64_t end_ns = (node_count - kNewNodes) * kStep_ns;
  const auto is_late = [end_ns](const auto& item) { return item.timestamp_ns >= end_ns; };
  std::erase_if(earlier.nodes, is_late);
  std::erase_if(earlier.odometry, is_late);
  std::erase_if(earlier.ranges, is_late);
  return earlier;
}

struct Draws {
  std::vector<double> ates_m;
  std::vector<double> seconds;
};

struct Rejection {
  std::size_t right = 0;
  std::size_t rejected = 0;
  std::size_t outliers = 0;

  void Add(const Scenario& scenario, const std::vector<FactorVerdict>& verdicts) {
    std::map<FactorKey, bool> is_outlier;
    for (std::size_t i = 0; i < scenario.is_outlier.size(); ++i) {
      is_outlier[KeyOf(scenario.graph.ranges[i])] = scenario.is_outlier[i];
    }
    for (const FactorVerdict& verdict : verdicts) {
      const bool is_bad = is_outlier.at(verdict.factor);
      rejected += !verdict.is_inlier;
      outliers += is_bad;
      right += is_bad && !verdict.is_inlier;
    }
  }
};

double Share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 1 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

std::vector<TeamCase> StandardTeamCases() {
  return {{.name = "501 nodes", .node_count = 501},
          {.name = "2001 nodes", .node_count = 2001},
          {.name = "9999 nodes", .node_count = 9999},
          {.name = "2001 nodes, 25 % outliers, low drift", .has_low_drift = true, .outlier_ratio = 0.25},
          {.name = "2001 nodes, pairs biased by 0.1 m", .bias_sigma_m = 0.1},
          {.name = "2001 nodes, outliers of 0.1 to 5 m", .outlier_min_m = 0.1},
          {.name = "2001 nodes, noise correlated by 0.8", .correlation = 0.8}};
}

TeamRun RunTeam(const TeamCase& team, int seeds, const SolverOptions& options) {
  TeamRun run;
  run.team = team;
  run.seeds = seeds;
  std::map<Method, std::vector<double>> ates;
  std::map<Method, std::vector<double>> seconds;
  Draws warm;
  Draws windowed;
  Rejection rejection;
  for (int seed = 1; seed <= seeds; ++seed) {
    const ScenarioOptions drawn = OptionsOf(team, static_cast<std::uint64_t>(seed));
    const Scenario scenario = MakeScenario(drawn);
    for (const Method method : kMethods) {
      const MethodResult result = SolveWith(method, scenario.graph, scenario.agents, options);
      ates[method].push_back(TrajectoryErrorM(scenario, result.poses));
      seconds[method].push_back(result.seconds);
      if (method == Method::kStaged) rejection.Add(scenario, result.verdicts);
    }
    const PoseGraph earlier = Earlier(scenario.graph, drawn.node_count);
    const Solution last = SolvePoseGraph(earlier, scenario.agents, {}, options);
    const LastSolution known = ToLast(last);
    SolverOptions window = options;
    window.window_nodes = kWindowNodes;
    for (const auto& [how, figures] : {std::pair(&options, &warm), std::pair(&std::as_const(window), &windowed)}) {
      Solution solution;
      figures->seconds.push_back(
          SecondsOf([&] { solution = SolvePoseGraph(scenario.graph, scenario.agents, known, *how); }));
      figures->ates_m.push_back(TrajectoryErrorM(scenario, solution.poses));
    }
  }
  run.warm = ToFigures(warm.ates_m, warm.seconds);
  run.window = ToFigures(windowed.ates_m, windowed.seconds);
  for (const Method method : kMethods) run.methods[method] = ToFigures(ates[method], seconds[method]);
  run.precision = Share(rejection.right, rejection.rejected);
  run.recall = Share(rejection.right, rejection.outliers);
  return run;
}

UnknownStartsRun RunUnknownStarts(int runs, const SolverOptions& options) {
  UnknownStartsRun result;
  result.runs = runs;
  std::vector<double> seconds;
  for (int seed = 1; seed <= runs; ++seed) {
    TeamCase team;
    team.node_count = 1 + kRovers * kUnknownStartsNodes;
    ScenarioOptions drawn = OptionsOf(team, static_cast<std::uint64_t>(seed));
    Scenario scenario = MakeScenario(drawn);
    std::mt19937_64 rng(static_cast<std::uint64_t>(seed) + 2000);
    std::uniform_real_distribution<double> anywhere(-100, 100);
    for (const AgentId agent : {AgentId{2}, AgentId{3}}) {
      scenario.agents.at(agent).start.reset();
      const Pose moved = Pose::FromPlanar(anywhere(rng), anywhere(rng), anywhere(rng));
      for (GraphNode& node : scenario.graph.nodes) {
        if (node.key.agent == agent) node.map_from_node = moved * node.map_from_node;
      }
    }
    Solution solution;
    seconds.push_back(SecondsOf([&] { solution = SolvePoseGraph(scenario.graph, scenario.agents, {}, options); }));
    const bool is_right = solution.is_accepted && TrajectoryErrorM(scenario, solution.poses) < kRight_m;
    const bool is_ambiguous = std::any_of(solution.rovers.begin(), solution.rovers.end(),
                                          [](const auto& rover) { return rover.anchoring == Anchoring::kAmbiguous; });
    result.right += is_right;
    result.right_ambiguous += is_right && is_ambiguous;
    result.wrong_ambiguous += !is_right && is_ambiguous;
  }
  result.median_seconds = Median(std::move(seconds));
  return result;
}

}  // namespace moondb
