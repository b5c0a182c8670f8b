#include "bench/pgo_redraws.h"

#include <algorithm>

#include "actors/pgo/team_facts.h"
#include "apps/moondb_mission/measurement.h"
#include "bench/pgo_registration.h"
#include "model/metrics.h"
#include "model/team_member.h"

namespace moondb {
namespace {

// A range that exceeds the true distance by more than this counts as part of a burst: a series of ranges that are too
// long because the line of sight is blocked.
constexpr double kBurstMin_m = 0.5;

std::vector<GraphNode> TrueNodes(const Mission& mission, AgentId agent) {
  std::vector<GraphNode> nodes;
  for (const GraphNode& node : mission.graph.nodes) {
    if (node.key.agent != agent) continue;
    nodes.push_back(node);
    nodes.back().map_from_node = mission.truth.at(node.key);
  }
  std::sort(nodes.begin(), nodes.end(), [](const GraphNode& a, const GraphNode& b) { return a.key < b.key; });
  return nodes;
}

Mission Redraw(const Mission& mission, std::uint64_t seed) {
  Mission drawn = mission;
  drawn.graph.odometry.clear();
  Random starts = Random::Stream(seed, 1);
  Random odometry = Random::Stream(seed, 2);
  Random ranges = Random::Stream(seed, 3);
  std::map<NodeKey, Pose> raw;
  std::size_t node_count = mission.truth.size();
  std::int64_t period_ns = 1;
  for (MissionAgent& agent : drawn.agents) {
    if (agent.is_base_station) continue;
    const std::vector<GraphNode> nodes = TrueNodes(mission, agent.id);
    node_count = std::min(node_count, nodes.size());
    if (nodes.size() > 1) period_ns = nodes[1].timestamp_ns - nodes[0].timestamp_ns;
    agent.start = nodes.front().map_from_node;
    agent.start.position_m.x() += agent.start_sigma_m * starts.Normal();
    agent.start.position_m.y() += agent.start_sigma_m * starts.Normal();
    agent.start = agent.start * Pose::FromPlanar(0, 0, agent.start_sigma_rad * starts.Normal());
    raw[nodes.front().key] = agent.start;
    for (const OdometryEdge& step : MeasureOdometry(nodes, {}, odometry)) {
      raw[step.to] = raw.at(step.from) * step.from_from_to;
      drawn.graph.odometry.push_back(step);
    }
  }
  for (GraphNode& node : drawn.graph.nodes) {
    if (const auto pose = raw.find(node.key); pose != raw.end()) node.map_from_node = pose->second;
  }
  drawn.graph.ranges = MeasureRanges(drawn.agents, mission.truth, static_cast<int>(node_count), period_ns, {}, ranges);
  return drawn;
}

// Solves by least squares without the ranges of bursts. Finds these ranges with the true poses, which the compared
// methods do not know.
MethodResult SolveWithoutBursts(const Mission& mission, const SolverOptions& options) {
  const auto antenna_at = [&](const NodeKey& key) {
    return Eigen::Vector3d(mission.truth.at(key) * FindAgent(mission, key.agent)->antenna_m);
  };
  PoseGraph graph = mission.graph;
  std::erase_if(graph.ranges, [&](const RangeEdge& edge) {
    return edge.range_m - (antenna_at(edge.from) - antenna_at(edge.to)).norm() > kBurstMin_m;
  });
  return SolveWith(Method::kLeastSquares, graph, FactsOf(mission), options);
}

}  // namespace

RedrawRun RunRedraws(const std::string& name, const Mission& mission, int draws, bool has_matches,
                     const SolverOptions& options) {
  RedrawRun run;
  run.name = name;
  run.draws = draws;
  std::map<Method, std::vector<double>> ates;
  std::map<Method, std::vector<double>> seconds;
  std::vector<double> ates_with_matches;
  std::vector<double> seconds_with_matches;
  std::vector<double> ates_without_bursts;
  std::vector<double> seconds_without_bursts;
  for (int draw = 1; draw <= draws; ++draw) {
    const Mission drawn = Redraw(mission, static_cast<std::uint64_t>(draw));
    for (const Method method : kMethods) {
      const MethodResult result = SolveWith(method, drawn.graph, FactsOf(drawn), options);
      ates[method].push_back(CompareTrajectories(result.poses, mission.truth, RoverIds(mission)).rmse_m);
      seconds[method].push_back(result.seconds);
    }
    if (has_matches) {
      RegistrationAte ate;
      seconds_with_matches.push_back(SecondsOf([&] { ate = CompareRegistration(drawn, options); }));
      ates_with_matches.push_back(ate.with_m);
      run.worst_match_ratio = std::max(run.worst_match_ratio, ate.with_m / ate.without_m);
    }
    const MethodResult reported = SolveWithoutBursts(drawn, options);
    ates_without_bursts.push_back(CompareTrajectories(reported.poses, mission.truth, RoverIds(mission)).rmse_m);
    seconds_without_bursts.push_back(reported.seconds);
  }
  if (has_matches) run.with_matches = ToFigures(ates_with_matches, seconds_with_matches);
  run.without_bursts = ToFigures(ates_without_bursts, seconds_without_bursts);
  for (const Method method : kMethods) run.methods[method] = ToFigures(ates[method], seconds[method]);
  return run;
}

}  // namespace moondb
