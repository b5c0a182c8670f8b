#include "bench/pgo_graphs.h"

#include <algorithm>
#include <chrono>

#include "actors/merge/merge_maps.h"
#include "actors/pgo/standalone_solver.h"
#include "actors/pgo/team_facts.h"
#include "bench/pgo_methods.h"
#include "model/metrics.h"
#include "model/mission.h"

namespace moondb {
namespace {

namespace fs = std::filesystem;

bool IsMission(const fs::path& folder) { return fs::exists(folder / "agents.csv"); }

std::map<NodeKey, Pose> PosesOf(const StandaloneGraph& graph, const std::vector<Pose>& poses) {
  std::map<NodeKey, Pose> result;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!graph.nodes[i].is_point) result[graph.nodes[i].key] = poses[i];
  }
  return result;
}

std::vector<AgentId> AgentsOf(const StandaloneGraph& graph) {
  std::vector<AgentId> agents;
  for (const PlainNode& node : graph.nodes) {
    if (!node.is_point && (agents.empty() || agents.back() != node.key.agent)) agents.push_back(node.key.agent);
  }
  return agents;
}

// Names the robots of a graph file "robot 1", "robot 2" ... in the order of their ids.
std::vector<TrackAgent> NamedRobots(const std::vector<AgentId>& ids) {
  std::vector<TrackAgent> robots;
  for (const AgentId id : ids) robots.push_back({id, "robot " + std::to_string(robots.size() + 1)});
  return robots;
}

std::map<NodeKey, Pose> Moved(const Pose& by, const std::map<NodeKey, Pose>& poses) {
  std::map<NodeKey, Pose> moved;
  for (const auto& [key, pose] : poses) moved[key] = by * pose;
  return moved;
}

class PlainRunner {
 public:
  PlainRunner(StandaloneGraph graph, bool has_truth, const GraphBenchOptions& options)
      : graph_(std::move(graph)), agents_(AgentsOf(graph_)), has_truth_(has_truth), bench_(options) {
    options_.thread_count = options.solver.thread_count;
    for (const PlainNode& node : graph_.nodes) {
      if (!node.is_point) truth_[node.key] = node.vertex;
    }
  }

  GraphRun Run(std::string name) {
    GraphRun run;
    run.name = std::move(name);
    run.node_count = graph_.nodes.size();
    run.edge_count = graph_.steps.size() + graph_.sightings.size();
    run.range_count = graph_.ranges.size();
    PlainSolution solution;
    run.ours.seconds = SecondsOf([&] { solution = SolveStandaloneGraph(graph_, options_); });
    Fill(solution, run.ours);
    run.initialisation = ToString(solution.initial_values);
    run.text = solution.text;
    run.tracks = TracksOf(Placed(solution), NamedRobots(agents_));
    if (has_truth_) run.true_tracks = TracksOf(truth_, NamedRobots(agents_));
    if (!bench_.has_plain) return run;
    PlainSolution plain;
    run.plain.emplace();
    run.plain->seconds = SecondsOf([&] { plain = SolveFromOdometry(graph_, options_); });
    Fill(plain, *run.plain);
    run.odometry_tracks = TracksOf(Placed(plain), NamedRobots(agents_));
    return run;
  }

 private:
  std::map<NodeKey, Pose> Placed(const PlainSolution& solution) const {
    const std::map<NodeKey, Pose> poses = PosesOf(graph_, solution.poses);
    return has_truth_ ? Moved(FindAlignment(poses, truth_, graph_.is_planar), poses) : poses;
  }

  void Fill(const PlainSolution& solution, GraphResult& result) const {
    result.has_converged = solution.has_converged;
    result.cost = solution.cost;
    if (has_truth_) result.ate_m = CompareTrajectories(Placed(solution), truth_, agents_).rmse_m;
  }

  StandaloneGraph graph_;
  std::vector<AgentId> agents_;
  bool has_truth_;
  const GraphBenchOptions& bench_;
  PlainOptions options_;
  std::map<NodeKey, Pose> truth_;
};

Result<MergedMap> MergeAt(const Mission& mission, const std::map<NodeKey, Pose>& poses) {
  std::vector<MapAtPose> maps;
  for (const MissionMap& map : mission.maps) {
    Result<TraversabilityMap> cells = ReadMissionMap(mission, map);
    if (!cells) return tl::unexpected(cells.error());
    const auto pose = poses.find(map.node);
    if (pose == poses.end()) return Fail(ErrorCode::kNotFound, "no pose of " + ToString(map.node));
    maps.push_back({NumberedMapKey(map.agent, maps.size() + 1), map.timestamp_ns, pose->second, *std::move(cells)});
  }
  std::vector<Pose> footprints;
  for (const auto& [key, pose] : poses) {
    const MissionAgent* agent = FindAgent(mission, key.agent);
    if (agent != nullptr && !agent->is_base_station) footprints.push_back(pose);
  }
  MergeOptions options;
  options.backend = MergeBackend::kCpu;
  return MergeMaps(maps, footprints, options);
}

Result<GraphRun> RunMission(const fs::path& folder, const GraphBenchOptions& options) {
  const Result<Mission> mission = ReadMission(folder);
  if (!mission) return tl::unexpected(mission.error());
  const AgentFactsMap agents = FactsOf(*mission);
  const std::vector<AgentId> rovers = RoverIds(*mission);
  GraphRun run;
  run.name = fs::weakly_canonical(folder).filename().string();
  run.is_team = true;
  run.node_count = mission->graph.nodes.size();
  run.edge_count = mission->graph.odometry.size();
  run.range_count = mission->graph.ranges.size();
  Solution solution;
  run.ours.seconds = SecondsOf([&] { solution = SolvePoseGraph(mission->graph, agents, {}, options.solver); });
  run.ours.has_converged = solution.is_accepted;
  run.ours.cost = solution.final_cost;
  run.ours.ate_m = CompareTrajectories(solution.poses, mission->truth, rovers).rmse_m;
  run.ours.hazard_iou = HazardIou(*mission, solution.poses);
  run.initialisation = ToString(solution.initial_values);
  run.text = solution.text;
  std::vector<TrackAgent> named;
  for (const AgentId rover : rovers) named.push_back({rover, FindAgent(*mission, rover)->name});
  run.odometry_tracks = TracksOf(moondb::PosesOf(mission->graph), named);
  run.tracks = TracksOf(solution.poses, named);
  run.true_tracks = TracksOf(mission->truth, named);
  if (!options.has_plain) return run;
  const MethodResult plain = SolveWith(Method::kLeastSquares, mission->graph, agents, options.solver);
  run.plain =
      GraphResult{plain.has_converged, plain.cost, CompareTrajectories(plain.poses, mission->truth, rovers).rmse_m,
                  plain.seconds, HazardIou(*mission, plain.poses)};
  return run;
}

}  // namespace

std::optional<double> HazardIou(const Mission& mission, const std::map<NodeKey, Pose>& poses) {
  if (mission.maps.empty()) return std::nullopt;
  const Result<MergedMap> map = MergeAt(mission, poses);
  const Result<MergedMap> truth = MergeAt(mission, mission.truth);
  if (!map || !truth) return std::nullopt;
  const Result<MapAgreement> agreement = CompareMaps(*map, *truth);
  if (!agreement) return std::nullopt;
  return agreement->hazard_iou;
}

std::vector<fs::path> FindGraphs(const fs::path& folder) {
  if (IsMission(folder)) return {folder};
  std::vector<fs::path> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const fs::path ending = entry.path().extension();
    const bool is_graph = entry.is_regular_file() && (ending == ".g2o" || ending == ".pyfg");
    if (is_graph || (entry.is_directory() && IsMission(entry.path()))) found.push_back(entry.path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

Result<GraphRun> RunGraph(const fs::path& path, const GraphBenchOptions& options) {
  if (fs::is_directory(path)) return RunMission(path, options);
  const std::string name = path.stem().string();
  if (path.extension() == ".g2o") {
    const Result<G2o> g2o = ReadG2o(path, {.check = InformationCheck::kBlocks});
    if (!g2o) return tl::unexpected(g2o.error());
    return PlainRunner(ToStandaloneGraph(*g2o), /*has_truth=*/false, options).Run(name);
  }
  const Result<Pyfg> pyfg = ReadPyfg(path);
  if (!pyfg) return tl::unexpected(pyfg.error());
  return PlainRunner(ToStandaloneGraph(*pyfg), /*has_truth=*/true, options).Run(name);
}

}  // namespace moondb
