#include "bench/pgo_redraws.h"

#include <algorithm>

#include "actors/pgo/team_facts.h"
#include "bench/pgo_registration.h"
#include "bench/redraw.h"
#include "model/metrics.h"
#include "model/team_member.h"

namespace moondb {
namespace {

// A range that exceeds the true distance by more than this counts as part of a burst: a series of ranges that are too
// long because the line of sight is blocked.
constexpr double kBurstMin_m = 0.5;

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
