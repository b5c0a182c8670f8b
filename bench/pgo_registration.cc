#include "bench/pgo_registration.h"

#include <fmt/core.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <numbers>
#include <set>

#include "actors/pgo/team_facts.h"
#include "actors/registration/match_plan.h"
#include "apps/moondb_mission/random.h"
#include "bench/pgo_graphs.h"
#include "model/metrics.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr double kRight_m = 0.2;
constexpr double kRight_rad = 2 * std::numbers::pi / 180;
constexpr double kWrongShare = 0.6;
constexpr double kWrongNear_m = 6;
constexpr double kWrong_m = 3;
constexpr double kWrong_rad = 0.5;

// Returns the CPU time that this thread takes to run `run`.
template <typename Run>
double CpuSecondsOf(const Run& run) {
  const auto now = [] {
    timespec time = {};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  const double begin = now();
  run();
  return now() - begin;
}

class Registrar {
 public:
  Registrar(std::string name, const Mission& mission, const SolverOptions& options, bool has_ranges)
      : name_(std::move(name)),
        mission_(mission),
        options_(options),
        agents_(FactsOf(mission)),
        has_ranges_(has_ranges),
        graph_(mission.graph) {
    if (!has_ranges) graph_.ranges.clear();
    fields_.resize(mission.maps.size());
  }

  RegistrationRun Solve(const std::string& what) {
    graph_.closures.clear();
    for (const auto& [nodes, closure] : closures_) graph_.closures.push_back(closure);
    const Solution solution = SolvePoseGraph(graph_, agents_, {}, options_);
    poses_ = solution.poses;
    RegistrationRun run;
    run.mission = name_;
    run.what = what;
    run.has_ranges = has_ranges_;
    run.match_count = closures_.size();
    run.candidate_count = times_.size();
    run.verdicts = std::exchange(verdicts_, {});
    run.refused_set_count = solution.refused.size();
    for (const FactorVerdict& verdict : solution.verdicts) {
      if (verdict.factor.kind == FactorKind::kLoopClosure && verdict.is_inlier) Judge(verdict.factor, run);
    }
    run.seconds = std::exchange(field_seconds_, 0);
    for (const double seconds : times_) run.seconds += seconds;
    if (!times_.empty()) {
      std::ranges::sort(times_);
      run.median_ms = 1000 * times_[times_.size() / 2];
    }
    times_.clear();
    run.ate_m = CompareTrajectories(solution.poses, mission_.truth, RoverIds(mission_)).rmse_m;
    run.hazard_iou = HazardIou(mission_, solution.poses);
    return run;
  }

  void Pass() {
    std::vector<RegisteredMap> maps;
    for (std::size_t i = 0; i < mission_.maps.size(); ++i) {
      const MissionMap& map = mission_.maps[i];
      const Pose& pose = poses_.at(map.node);
      maps.push_back({{{map.agent, 1, proto::LOCAL_TRAVERSABILITY_MAP}, i + 1},
                      map.node,
                      map.timestamp_ns,
                      pose,
                      pose * map.node_from_map});
    }
    for (const PlannedMatch& planned : plan_.StartPass(maps, [](AgentId, AgentId) { return true; })) {
      const HazardField& first = FieldOf(planned.first.key);
      const HazardField& second = FieldOf(planned.second.key);
      MatchResult result;
      times_.push_back(CpuSecondsOf([&] { result = MatchMaps(first, second, planned.expected, planned.window); }));
      plan_.Note(planned, result);
      ++verdicts_[ToString(result.verdict)];
      if (result.verdict != MatchVerdict::kAccepted) continue;
      closures_[{planned.first.node, planned.second.node}] = ToLoopClosure(planned.first, planned.second, result);
    }
  }

  // Adds random wrong matches of nearby nodes, off by up to 3 m and 0.5 rad, until they are 60 % of all.
  void AddWrong() {
    Random random = Random::Stream(1, 9);
    std::vector<NodeKey> nodes;
    for (const auto& [node, pose] : poses_) {
      if (!FindAgent(mission_, node.agent)->is_base_station) nodes.push_back(node);
    }
    const std::size_t right = closures_.size();
    const auto wanted = static_cast<std::size_t>(static_cast<double>(right) / (1 - kWrongShare));
    for (int tries = 0; closures_.size() < wanted && tries < 1'000'000; ++tries) {
      const NodeKey from = nodes[static_cast<std::size_t>(random.Index(static_cast<int>(nodes.size())))];
      const NodeKey to = nodes[static_cast<std::size_t>(random.Index(static_cast<int>(nodes.size())))];
      const Pose true_from_to = mission_.truth.at(from).Inverse() * mission_.truth.at(to);
      if (!(from < to) || true_from_to.position_m.norm() > kWrongNear_m || closures_.contains({from, to})) continue;
      LoopClosure closure = closures_.begin()->second;
      closure.from = from;
      closure.to = to;
      closure.from_from_to =
          true_from_to * Pose::FromPlanar(random.Uniform(-kWrong_m, kWrong_m), random.Uniform(-kWrong_m, kWrong_m),
                                          random.Uniform(-kWrong_rad, kWrong_rad));
      closures_[{from, to}] = closure;
    }
  }

  // Moves all matches between the first two rovers by the same vector in the frame of the first rover's nodes.
  void Shift(double shift_m) {
    const std::vector<AgentId> rovers = RoverIds(mission_);
    for (auto& [nodes, closure] : closures_) {
      if (nodes.first.agent != rovers[0] || nodes.second.agent != rovers[1]) continue;
      const Eigen::Vector3d shift = shift_m * Eigen::Vector3d(2, 1, 0).normalized();
      closure.from_from_to.position_m += poses_.at(nodes.first).orientation.conjugate() * shift;
    }
  }

  std::map<std::pair<NodeKey, NodeKey>, LoopClosure>& closures() { return closures_; }

 private:
  void Judge(const FactorKey& factor, RegistrationRun& run) const {
    const LoopClosure& closure = closures_.at({factor.from, factor.to});
    const Pose error =
        closure.from_from_to.Inverse() * (mission_.truth.at(closure.from).Inverse() * mission_.truth.at(closure.to));
    const double error_m = error.position_m.head<2>().norm();
    ++run.used_count;
    run.worst_used_m = std::max(run.worst_used_m, error_m);
    if (error_m <= kRight_m && std::abs(error.Yaw()) <= kRight_rad) ++run.right_count;
  }

  const HazardField& FieldOf(const RecordKey& key) {
    std::unique_ptr<const HazardField>& field = fields_[key.seq - 1];
    if (field == nullptr) {
      const Result<TraversabilityMap> map = ReadMissionMap(mission_, mission_.maps[key.seq - 1]);
      field_seconds_ += CpuSecondsOf([&] {
        field = std::make_unique<const HazardField>(map ? *map : TraversabilityMap(), std::vector<MaskedDisc>());
      });
    }
    return *field;
  }

  const std::string name_;
  const Mission& mission_;
  const SolverOptions& options_;
  const AgentFactsMap agents_;
  const bool has_ranges_;
  PoseGraph graph_;
  MatchPlan plan_{{}};
  std::vector<std::unique_ptr<const HazardField>> fields_;
  double field_seconds_ = 0;
  std::vector<double> times_;
  std::map<std::string, std::size_t> verdicts_;
  std::map<NodeKey, Pose> poses_;
  std::map<std::pair<NodeKey, NodeKey>, LoopClosure> closures_;
};

}  // namespace

std::vector<RegistrationRun> RunRegistration(const std::string& name, const Mission& mission,
                                             const SolverOptions& options) {
  std::vector<RegistrationRun> runs;
  for (const bool has_ranges : {true, false}) {
    Registrar registrar(name, mission, options, has_ranges);
    runs.push_back(registrar.Solve("no matches"));
    for (const char* const pass : {"first pass", "second pass", "third pass"}) {
      registrar.Pass();
      runs.push_back(registrar.Solve(pass));
    }
    const auto right = registrar.closures();
    registrar.AddWrong();
    runs.push_back(registrar.Solve("60 % wrong"));
    for (const double shift_m : {0.5, 0.7, 0.9}) {
      registrar.closures() = right;
      registrar.Shift(shift_m);
      runs.push_back(registrar.Solve(fmt::format("a set shifted by {:.1f} m", shift_m)));
    }
  }
  return runs;
}

RegistrationAte CompareRegistration(const Mission& mission, const SolverOptions& options) {
  Registrar registrar("", mission, options, /*has_ranges=*/true);
  RegistrationAte ate;
  ate.without_m = registrar.Solve("").ate_m;
  registrar.Pass();
  (void)registrar.Solve("");
  registrar.Pass();
  ate.with_m = registrar.Solve("").ate_m;
  return ate;
}

}  // namespace moondb
