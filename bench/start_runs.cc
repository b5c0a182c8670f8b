#include "bench/start_runs.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>
#include <numbers>

#include "actors/registration/start_search.h"
#include "bench/measure.h"
#include "bench/process_status.h"
#include "bench/redraw.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr AgentId kAgentsOfMission = 100;  // Agents of the second mission begin above this number.
constexpr double kWrong_m = 1;
constexpr double kWrong_deg = 5;

class Searcher {
 public:
  explicit Searcher(const std::vector<const Mission*>& missions, double part) : maps_(Options(missions)) {
    for (std::size_t i = 0; i < missions.size(); ++i)
      Add(*missions[i], static_cast<AgentId>(i) * kAgentsOfMission, part);
    const std::vector<RegisteredMap> registered = maps_.FindRegistered();
    for (const auto& [agent, name] : names_) {
      if (auto rover = SearchedRover::Find(agent, registered, maps_)) rovers_.emplace(agent, *std::move(rover));
    }
  }

  std::vector<AgentId> rovers() const {
    std::vector<AgentId> agents;
    for (const auto& [agent, rover] : rovers_) agents.push_back(agent);
    return agents;
  }
  const std::string& NameOf(AgentId agent) const { return names_.at(agent); }

  AnywhereRun Search(AgentId a, AgentId b) {
    StartSearch search;
    FieldCache fields(64);
    AnywhereRun run;
    run.rovers = NameOf(a) + ", " + NameOf(b);
    run.is_same_mission = a / kAgentsOfMission == b / kAgentsOfMission;
    const double begin = CpuSeconds();
    search.Begin(rovers_, {{a, b}});
    std::vector<double> errors_m, errors_deg;
    while (search.left_count() > 0) {
      const double step = CpuSeconds();
      for (const auto& [planned, result] : search.Step(maps_, fields)) {
        ++run.match_count;
        if (!run.is_same_mission) continue;
        const PlanarOffset truth =
            true_from_local_.at(planned.first.key).Inverse() * true_from_local_.at(planned.second.key);
        const PlanarOffset error = truth.Inverse() * result.first_from_second;
        errors_m.push_back(error.position_m().norm());
        errors_deg.push_back(std::abs(error.yaw_rad) * 180 / std::numbers::pi);
      }
      run.step_max_ms = std::max(run.step_max_ms, 1000 * (CpuSeconds() - step));
    }
    run.seconds = CpuSeconds() - begin;
    const JudgedStart& judged = search.judged().at({a, b});
    run.verdict = ToString(judged.verdict);
    run.is_placed = judged.verdict == StartVerdict::kAccepted;
    run.evidence = judged.best.evidence;
    run.rival = judged.rival;
    run.matched = judged.best.matched;
    run.contradicted = judged.best.contradicted;
    if (!errors_m.empty()) {
      run.error_m = Median(errors_m);
      run.error_deg = Median(errors_deg);
    }
    run.is_wrong = run.is_placed && (!run.is_same_mission || run.error_m > kWrong_m || run.error_deg > kWrong_deg);
    return run;
  }

 private:
  static KnownMaps::Options Options(const std::vector<const Mission*>& missions) {
    KnownMaps::Options options;
    for (std::size_t i = 0; i < missions.size(); ++i) {
      for (const AgentId agent : RoverIds(*missions[i])) {
        options.rovers.insert(agent + static_cast<AgentId>(i) * kAgentsOfMission);
      }
    }
    return options;
  }

  RecordKey NextKey(AgentId agent, DataType type) { return {{agent, 1, type}, ++seq_}; }

  void Add(const Mission& mission, AgentId offset, double part) {
    std::int64_t first_ns = INT64_MAX, last_ns = INT64_MIN;
    for (const GraphNode& node : mission.graph.nodes) {
      first_ns = std::min(first_ns, node.timestamp_ns);
      last_ns = std::max(last_ns, node.timestamp_ns);
    }
    const auto end_ns = first_ns + static_cast<std::int64_t>(part * static_cast<double>(last_ns - first_ns));
    for (const AgentId agent : RoverIds(mission)) {
      names_[agent + offset] = mission.folder.filename().string() + " " + std::to_string(agent);
    }
    for (GraphNode node : mission.graph.nodes) {
      if (!names_.contains(node.key.agent + offset) || node.timestamp_ns > end_ns) continue;
      node.key.agent += offset;
      (void)maps_.Add(NextKey(node.key.agent, proto::POSE_GRAPH_NODE), ToRecord(node));
      proto::Record solved;
      *solved.mutable_optimized_pose()->mutable_node() = ToProto(node.key);
      *solved.mutable_optimized_pose()->mutable_map_from_node() = ToProto(node.map_from_node);
      (void)maps_.Add(NextKey(1, proto::OPTIMIZED_POSE), solved);
    }
    for (OdometryEdge edge : mission.graph.odometry) {
      edge.from.agent += offset;
      edge.to.agent += offset;
      (void)maps_.Add(NextKey(edge.to.agent, proto::POSE_GRAPH_EDGE), ToRecord(edge));
    }
    for (const MissionMap& map : mission.maps) {
      if (map.timestamp_ns > end_ns) continue;
      Result<TraversabilityMap> cells = ReadMissionMap(mission, map);
      if (!cells) continue;
      cells->node.agent += offset;
      proto::Record record;
      record.set_timestamp_ns(map.timestamp_ns);
      *record.mutable_local_traversability_map() = ToProto(*cells);
      const RecordKey key = NextKey(map.agent + offset, proto::LOCAL_TRAVERSABILITY_MAP);
      true_from_local_[key] = PlanarOffset::From(mission.truth.at(map.node) * map.node_from_map);
      (void)maps_.Add(key, record);
    }
  }

  KnownMaps maps_;
  std::map<AgentId, SearchedRover> rovers_;
  std::map<AgentId, std::string> names_;
  std::map<RecordKey, PlanarOffset> true_from_local_;
  std::uint64_t seq_ = 0;
};

}  // namespace

std::vector<AnywhereRun> RunAnywhere(const std::vector<Mission>& missions, int draws) {
  std::vector<AnywhereRun> runs;
  for (int draw = 0; draw <= draws; ++draw) {
    std::vector<Mission> drawn;
    for (const Mission& mission : missions) {
      drawn.push_back(draw == 0 ? mission : Redraw(mission, static_cast<std::uint64_t>(draw)));
    }
    for (const double part : {1.0, 0.5, 0.25}) {
      std::vector<const Mission*> all;
      for (const Mission& mission : drawn) all.push_back(&mission);
      Searcher searcher(all, part);
      const std::vector<AgentId> rovers = searcher.rovers();
      for (std::size_t i = 0; i < rovers.size(); ++i) {
        for (std::size_t j = i + 1; j < rovers.size(); ++j) {
          AnywhereRun run = searcher.Search(rovers[i], rovers[j]);
          run.draw = draw;
          run.part = part;
          runs.push_back(run);
        }
      }
    }
  }
  return runs;
}

std::string TextOf(const std::vector<AnywhereRun>& runs) {
  std::string text = "Rovers that started anywhere\n";
  std::size_t placed = 0, wrong = 0, same = 0;
  for (const AnywhereRun& run : runs) {
    text += fmt::format(
        "{}, draw {}, {:.0f} % of the time: {}; evidence {:.1f}, rival {:.1f}, matched {:.3f}, contradicted {:.3f}; {} "
        "matches, median error {:.2f} m, {:.1f} deg; {:.1f} s, longest step {:.0f} ms{}\n",
        run.rovers, run.draw, 100 * run.part, run.verdict, run.evidence, run.rival, run.matched, run.contradicted,
        run.match_count, run.error_m, run.error_deg, run.seconds, run.step_max_ms, run.is_wrong ? "  WRONG" : "");
    placed += run.is_placed ? 1 : 0;
    wrong += run.is_wrong ? 1 : 0;
    same += run.is_same_mission ? 1 : 0;
  }
  return text + fmt::format("{} pairs of one mission, {} across: {} placed, {} wrong\n", same, runs.size() - same,
                            placed, wrong);
}

std::string JsonOf(const std::vector<AnywhereRun>& runs) {
  std::string text = "[";
  for (const AnywhereRun& run : runs) {
    text += fmt::format(
        "{}{{\"rovers\": \"{}\", \"draw\": {}, \"part\": {}, \"verdict\": \"{}\", \"is_wrong\": {}, \"evidence\": "
        "{:.2f}, "
        "\"rival\": {:.2f}, \"matched\": {:.4f}, \"contradicted\": {:.4f}, \"matches\": {}, \"error_m\": {:.4f}, "
        "\"error_deg\": {:.3f}, \"seconds\": {:.2f}, \"step_max_ms\": {:.1f}}}",
        text.size() == 1 ? "" : ",\n", run.rovers, run.draw, run.part, run.verdict, run.is_wrong, run.evidence,
        run.rival, run.matched, run.contradicted, run.match_count, run.error_m, run.error_deg, run.seconds,
        run.step_max_ms);
  }
  return text + "]";
}

}  // namespace moondb
