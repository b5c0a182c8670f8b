#include "bench/pgo_lies.h"

#include <fmt/core.h>

#include <algorithm>
#include <functional>

#include "actors/pgo/known_graph.h"
#include "actors/pgo/team_facts.h"
#include "bench/pgo_methods.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

// The records of a team, some of them false.
class Team {
 public:
  Team(const Mission& mission, AgentId liar) : mission_(mission), liar_(liar) {}

  void AddTruth(const std::function<void(OdometryEdge&)>& change_odometry,
                const std::function<void(GraphNode&)>& change_node) {
    for (GraphNode node : mission_.graph.nodes) {
      if (node.key.agent == liar_ && change_node) change_node(node);
      Add(node.key.agent, ToRecord(node));
    }
    for (OdometryEdge edge : mission_.graph.odometry) {
      if (edge.from.agent == liar_ && change_odometry) change_odometry(edge);
      Add(edge.from.agent, ToRecord(edge));
    }
    for (const RangeEdge& edge : mission_.graph.ranges) Add(edge.from.agent, ToRecord(edge));
    for (const LoopClosure& edge : mission_.graph.closures) Add(edge.from.agent, ToRecord(edge));
  }

  // Returns where the liar claims to be at a node: its true pose, moved by `shift_m` (times the part of the mission
  // that has passed, if `is_growing`).
  Pose Claimed(const NodeKey& node, double shift_m, bool is_growing) const {
    Pose pose = mission_.truth.at(node);
    const double part = is_growing ? static_cast<double>(node.index) / NodeCount(node.agent) : 1;
    pose.position_m += part * shift_m * Eigen::Vector3d(2, 1, 0).normalized();
    return pose;
  }

  // Loop closures from about 40 nodes of the liar to the nodes of the same number of each other rover.
  void AddClosures(double shift_m, double sigma_m, int sources, bool is_growing) {
    const double count = NodeCount(liar_);
    const auto step = static_cast<std::uint64_t>(std::max(1.0, count / 40));
    for (int source = 0; source < sources; ++source) {
      for (const AgentId other : RoverIds(mission_)) {
        if (other == liar_) continue;
        for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(count); i += step) {
          const NodeKey from{liar_, i};
          const NodeKey to{other, i};
          if (!mission_.truth.contains(to)) continue;
          LoopClosure closure;
          closure.from = from;
          closure.to = to;
          closure.from_from_to = Claimed(from, shift_m, is_growing).Inverse() * mission_.truth.at(to);
          closure.covariance = Matrix6d::Identity() * 0.01 * 0.01;
          closure.covariance.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * sigma_m * sigma_m;
          closure.source = fmt::format("tool{}", source);
          Add(liar_, ToRecord(closure));
        }
      }
    }
  }

  // Ranges from 8 nodes of the liar to about 40 nodes of each other rover.
  void AddRanges(double shift_m, double sigma_m) {
    const double count = NodeCount(liar_);
    for (const AgentId other : RoverIds(mission_)) {
      if (other == liar_) continue;
      const double others = NodeCount(other);
      for (int i = 0; i < 8; ++i) {
        for (int j = 0; j < 40; ++j) {
          const NodeKey from{liar_, static_cast<std::uint64_t>((i + 0.5) * count / 8)};
          const NodeKey to{other, static_cast<std::uint64_t>((j + 0.5) * others / 40)};
          RangeEdge edge;
          edge.from = from;
          edge.to = to;
          edge.timestamp_ns = TimestampOf(to);
          const auto antenna = [&](const NodeKey& node, const Pose& pose) {
            return Eigen::Vector3d(pose * FindAgent(mission_, node.agent)->antenna_m);
          };
          edge.range_m = (antenna(from, Claimed(from, shift_m, false)) - antenna(to, mission_.truth.at(to))).norm();
          edge.variance_m2 = sigma_m * sigma_m;
          Add(liar_, ToRecord(edge));
        }
      }
    }
  }

  void AddPriors(double shift_m, double sigma_m) {
    for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(NodeCount(liar_)); i += 2) {
      NodePrior prior;
      prior.node = {liar_, i};
      prior.map_from_node = Claimed(prior.node, shift_m, false);
      prior.covariance = Matrix6d::Identity() * sigma_m * sigma_m;
      prior.source = "gnss";
      Add(liar_, ToRecord(prior));
    }
  }

  PoseGraph ForSolve() const { return known_.SelectForSolve({UINT64_MAX, UINT64_MAX}).graph; }

 private:
  void Add(AgentId origin, const proto::Record& record) {
    const DataType type = record.has_pose_graph_node() ? proto::POSE_GRAPH_NODE
                          : record.has_pose_prior()    ? proto::POSE_PRIOR
                                                       : proto::POSE_GRAPH_EDGE;
    (void)known_.Add({{origin, 1, type}, ++seq_}, record);
  }

  double NodeCount(AgentId agent) const {
    return static_cast<double>(
        std::ranges::count_if(mission_.truth, [agent](const auto& entry) { return entry.first.agent == agent; }));
  }

  std::int64_t TimestampOf(const NodeKey& key) const {
    const auto found = std::ranges::find(mission_.graph.nodes, key, &GraphNode::key);
    return found == mission_.graph.nodes.end() ? 0 : found->timestamp_ns;
  }

  const Mission& mission_;
  const AgentId liar_;
  KnownGraph known_;
  std::uint64_t seq_ = 0;
};

struct Lie {
  std::string name;
  std::function<void(Team&)> add;
  std::function<void(OdometryEdge&)> change_odometry = {};
  std::function<void(GraphNode&)> change_node = {};
};

std::vector<Lie> AllLies() {
  std::vector<Lie> lies;
  const auto none = [](Team&) {};
  for (const int sources : {1, 4, 40, 100}) {
    for (const double shift_m : {0.3, 0.5, 0.7, 1.0, 2.0, 5.0}) {
      if (sources == 4 && shift_m > 1) continue;
      lies.push_back({fmt::format("closures {:.1f} m, {} sources", shift_m, sources),
                      [=](Team& team) { team.AddClosures(shift_m, 0.05, sources, false); }});
    }
  }
  for (const double shift_m : {1.0, 3.0}) {
    lies.push_back({fmt::format("closures growing to {:.0f} m", shift_m),
                    [=](Team& team) { team.AddClosures(shift_m, 0.05, 10, true); }});
    lies.push_back({fmt::format("closures {:.0f} m, sigma 1 mm", shift_m),
                    [=](Team& team) { team.AddClosures(shift_m, 0.001, 3, false); }});
  }
  for (const double sigma_m : {0.001, 0.1, 1.0, 10.0}) {
    for (const double shift_m : {0.4, 1.0, 3.0}) {
      lies.push_back({fmt::format("ranges {:.1f} m, sigma {} m", shift_m, sigma_m),
                      [=](Team& team) { team.AddRanges(shift_m, sigma_m); }});
    }
  }
  for (const double shift_m : {0.5, 1.0, 3.0}) {
    lies.push_back({fmt::format("priors {:.1f} m", shift_m), [=](Team& team) { team.AddPriors(shift_m, 0.01); }});
    lies.push_back({fmt::format("closures, ranges, priors {:.1f} m", shift_m), [=](Team& team) {
                      team.AddClosures(shift_m, 0.05, 10, false);
                      team.AddRanges(shift_m, 0.1);
                      team.AddPriors(shift_m, 0.01);
                    }});
  }
  for (const double scale : {1.1, 1.5}) {
    lies.push_back({fmt::format("odometry scaled by {:.1f}", scale), none, [=](OdometryEdge& edge) {
                      edge.from_from_to.position_m *= scale;
                      edge.covariance = Matrix6d::Identity() * 1e-8;
                    }});
  }
  lies.push_back({"odometry that turns", none, [](OdometryEdge& edge) {
                    edge.from_from_to = edge.from_from_to * Pose::FromPlanar(0, 0, 0.01);
                    edge.covariance = Matrix6d::Identity() * 1e-8;
                  }});
  lies.push_back({"nodes tilted and 100 m away", none, {}, [](GraphNode& node) {
                    node.map_from_node.position_m.x() += 100;
                    node.map_from_node.orientation =
                        Eigen::Quaterniond(Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitX()));
                  }});
  return lies;
}

void Compare(const Solution& honest, const Solution& solution, AgentId liar, LieRun& run) {
  std::map<AgentId, std::vector<double>> moves_m;
  for (const auto& [node, pose] : honest.poses) {
    const auto found = solution.poses.find(node);
    if (node.agent == liar || found == solution.poses.end()) continue;
    moves_m[node.agent].push_back((pose.position_m - found->second.position_m).norm());
  }
  for (const auto& [agent, moves] : moves_m) {
    run.median_move_m = std::max(run.median_move_m, Median(moves));
    run.largest_move_m = std::max(run.largest_move_m, *std::ranges::max_element(moves));
  }
  std::map<FactorKey, bool> was_inlier;
  for (const FactorVerdict& verdict : honest.verdicts) was_inlier[verdict.factor] = verdict.is_inlier;
  for (const FactorVerdict& verdict : solution.verdicts) {
    const auto found = was_inlier.find(verdict.factor);
    if (found != was_inlier.end() && found->second && !verdict.is_inlier) ++run.rejected_count;
  }
  for (const FactorSet& set : solution.refused) {
    const bool is_liars = set.producer == liar || set.agents.first == liar || set.agents.second == liar;
    run.is_named = run.is_named || is_liars;
    run.named_others += !is_liars;
  }
}

}  // namespace

std::vector<LieRun> RunLies(const std::string& name, const Mission& mission, const SolverOptions& options,
                            const std::string& only) {
  const AgentFactsMap agents = FactsOf(mission);
  std::vector<LieRun> runs;
  Team truth(mission, 0);
  truth.AddTruth({}, {});
  const PoseGraph graph = truth.ForSolve();
  Solution honest;
  const double seconds = SecondsOf([&] { honest = SolvePoseGraph(graph, agents, {}, options); });
  runs.push_back({.mission = name, .lie = "none", .named_others = honest.refused.size(), .seconds = seconds});
  for (const AgentId liar : RoverIds(mission)) {
    for (const Lie& lie : AllLies()) {
      if (lie.name.find(only) == std::string::npos) continue;
      Team team(mission, liar);
      team.AddTruth(lie.change_odometry, lie.change_node);
      lie.add(team);
      for (const bool is_warm : {false, true}) {
        const PoseGraph lying = team.ForSolve();
        LieRun run{.mission = name, .lie = lie.name, .liar = liar, .is_warm = is_warm};
        Solution solution;
        run.seconds = SecondsOf(
            [&] { solution = SolvePoseGraph(lying, agents, is_warm ? ToLast(honest) : LastSolution(), options); });
        Compare(honest, solution, liar, run);
        runs.push_back(run);
      }
    }
  }
  return runs;
}

}  // namespace moondb
