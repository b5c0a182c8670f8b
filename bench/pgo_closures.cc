#include "bench/pgo_closures.h"

#include <fmt/core.h>

#include <algorithm>
#include <functional>

#include "actors/pgo/team_facts.h"
#include "apps/moondb_mission/random.h"
#include "bench/pgo_methods.h"
#include "model/metrics.h"
#include "model/team_member.h"

namespace moondb {
namespace {

constexpr double kSigma_m = 0.08;
constexpr double kSigma_rad = 0.01;
constexpr double kOtherSigma = 0.1;  // Sigma of z (m), and of roll and pitch (rad).
constexpr double kNear_m = 3;
constexpr std::size_t kOfNodeMax = 3;
constexpr std::uint64_t kApartNodes = 10;
constexpr double kWrong_m = 3;
constexpr double kWrong_rad = 0.5;
constexpr double kWrongShare = 0.6;

// How the drawn loop closures and priors are wrong.
struct Errors {
  double wrong_share = 0;
  double shift_m = 0;  // Offset of all loop closures between the first two rovers.
};

class Drawer {
 public:
  Drawer(const Mission& mission, const Errors& errors)
      : mission_(mission), errors_(errors), rovers_(RoverIds(mission)), random_(Random::Stream(1, 7)) {}

  std::vector<LoopClosure> Closures() {
    std::vector<std::pair<NodeKey, Pose>> nodes;
    for (const auto& [node, pose] : mission_.truth) {
      if (std::ranges::find(rovers_, node.agent) != rovers_.end()) nodes.emplace_back(node, pose);
    }
    std::vector<LoopClosure> closures;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      std::size_t count = 0;
      for (std::size_t j = i + 1; j < nodes.size() && count < kOfNodeMax; ++j) {
        const auto& [from, from_pose] = nodes[i];
        const auto& [to, to_pose] = nodes[j];
        if (from.agent == to.agent && to.index - from.index < kApartNodes) continue;
        if ((from_pose.position_m - to_pose.position_m).norm() > kNear_m) continue;
        ++count;
        closures.push_back(Draw(from, to, from_pose.Inverse() * to_pose));
      }
    }
    return closures;
  }

  // Returns a prior of the position of every tenth node.
  std::vector<NodePrior> Priors() {
    std::vector<NodePrior> priors;
    for (const auto& [node, pose] : mission_.truth) {
      if (node.index % kApartNodes != 0 || std::ranges::find(rovers_, node.agent) == rovers_.end()) continue;
      NodePrior prior;
      prior.node = node;
      prior.extent = PriorExtent::kPosition;
      prior.source = "gnss";
      const double sigma_m = IsWrong() ? kWrong_m : kSigma_m;
      prior.map_from_node.position_m =
          pose.position_m + Eigen::Vector3d(sigma_m * random_.Normal(), sigma_m * random_.Normal(), 0);
      prior.covariance.diagonal().head<3>() << kSigma_m * kSigma_m, kSigma_m * kSigma_m, kOtherSigma * kOtherSigma;
      priors.push_back(prior);
    }
    return priors;
  }

 private:
  bool IsWrong() { return random_.Uniform(0, 1) < errors_.wrong_share; }

  LoopClosure Draw(const NodeKey& from, const NodeKey& to, const Pose& from_from_to) {
    LoopClosure closure{from, to, 0, from_from_to, Matrix6d::Identity(), "matching"};
    double turn_rad = kSigma_rad * random_.Normal();
    Eigen::Vector3d error_m(kSigma_m * random_.Normal(), kSigma_m * random_.Normal(), 0);
    if (IsWrong()) {
      error_m += Eigen::Vector3d(random_.Uniform(-kWrong_m, kWrong_m), random_.Uniform(-kWrong_m, kWrong_m), 0);
      turn_rad += random_.Uniform(-kWrong_rad, kWrong_rad);
    }
    if (from.agent == rovers_[0] && to.agent == rovers_[1]) {
      error_m += errors_.shift_m * Eigen::Vector3d(2, 1, 0).normalized();
    }
    closure.from_from_to.position_m += error_m;
    closure.from_from_to.orientation = from_from_to.orientation * Pose::FromPlanar(0, 0, turn_rad).orientation;
    const double variance = kOtherSigma * kOtherSigma;
    closure.covariance.diagonal() << kSigma_m * kSigma_m, kSigma_m * kSigma_m, variance, variance, variance,
        kSigma_rad * kSigma_rad;
    return closure;
  }

  const Mission& mission_;
  const Errors errors_;
  const std::vector<AgentId> rovers_;
  Random random_;
};

Track LineOf(const std::string& name, const Color& color, TrackStyle style, const Pose& from, const Pose& to) {
  return {name, color, style, {{from.position_m.x(), from.position_m.y()}, {to.position_m.x(), to.position_m.y()}}};
}

}  // namespace

std::vector<ClosureRun> RunClosures(const std::string& name, const Mission& mission, const SolverOptions& options) {
  std::vector<std::pair<std::string, Errors>> cases = {{"right", {}}, {"60 % wrong", {kWrongShare, 0}}};
  for (const double shift_m : {0.3, 0.5, 0.7, 0.9}) {
    cases.emplace_back(fmt::format("a set shifted by {:.1f} m", shift_m), Errors{0, shift_m});
  }
  std::vector<ClosureRun> runs;
  const auto run = [&](const std::string& what, std::vector<LoopClosure> closures, bool has_ranges) {
    PoseGraph graph = mission.graph;
    graph.closures = std::move(closures);
    if (!has_ranges) graph.ranges.clear();
    ClosureRun result{name, what, has_ranges};
    Solution solution;
    result.seconds = SecondsOf([&] { solution = SolvePoseGraph(graph, FactsOf(mission), {}, options); });
    result.closure_count = solution.CountOf(FactorKind::kLoopClosure).usable;
    result.rejected_count = solution.CountOf(FactorKind::kLoopClosure).rejected;
    result.refused_set_count = solution.refused.size();
    result.ate_m = CompareTrajectories(solution.poses, mission.truth, RoverIds(mission)).rmse_m;
    runs.push_back(result);
  };
  for (const bool has_ranges : {true, false}) {
    run("none", {}, has_ranges);
    for (const auto& [what, errors] : cases) run(what, Drawer(mission, errors).Closures(), has_ranges);
  }
  return runs;
}

std::vector<Track> FactorTracks(const Mission& mission, const SolverOptions& options) {
  PoseGraph graph = mission.graph;
  Drawer drawer(mission, {.wrong_share = 0.5});
  graph.closures = drawer.Closures();
  graph.priors = drawer.Priors();
  const Solution solution = SolvePoseGraph(graph, FactsOf(mission), {}, options);
  std::map<NodeKey, Pose> poses = solution.poses;
  std::vector<Track> tracks;
  // Rejected factors are drawn last, so that accepted ones do not hide them.
  for (const bool is_inlier : {true, false}) {
    const std::string prefix = is_inlier ? "accepted " : "rejected ";
    const TrackStyle style = is_inlier ? TrackStyle::kThin : TrackStyle::kDashed;
    std::size_t prior = 0;
    for (const FactorVerdict& verdict : solution.verdicts) {
      const FactorKey& key = verdict.factor;
      const bool is_prior = key.kind == FactorKind::kPrior;
      const std::size_t index = is_prior ? prior++ : 0;
      if (verdict.is_inlier != is_inlier) continue;
      const Pose& from = poses.at(key.from);
      if (is_prior) {
        const Eigen::Vector3d& measured_m = graph.priors[index].map_from_node.position_m;
        tracks.push_back({prefix + "prior",
                          is_inlier ? Color{0, 158, 115} : Color{204, 121, 167},
                          TrackStyle::kThin,
                          {{measured_m.x(), measured_m.y()}}});
        if (is_inlier) continue;
        tracks.push_back(LineOf(prefix + "prior", {204, 121, 167}, style, from, Pose{measured_m, from.orientation}));
      } else if (key.kind == FactorKind::kLoopClosure) {
        const Color color = is_inlier ? Color{86, 180, 233} : Color{213, 94, 0};
        tracks.push_back(LineOf(prefix + "loop closure", color, style, from, poses.at(key.to)));
      } else {
        const Color color = is_inlier ? Color{200, 200, 206} : Color{40, 40, 40};
        tracks.push_back(LineOf(prefix + "range", color, style, from, poses.at(key.to)));
      }
    }
  }
  std::vector<TrackAgent> agents;
  for (const MissionAgent& agent : mission.agents) {
    if (!agent.is_base_station) agents.push_back({agent.id, agent.name});
  }
  for (Track& track : TracksOf(poses, agents)) tracks.push_back(std::move(track));
  return tracks;
}

}  // namespace moondb
