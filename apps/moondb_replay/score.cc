#include "apps/moondb_replay/score.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "actors/merge/map_collection.h"
#include "actors/pgo/pose_graph_solver.h"
#include "actors/pgo/team_facts.h"
#include "model/team_member.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

MergeOptions OptionsOf(const proto::TeamConfig& team) {
  MergeOptions options;
  options.backend = MergeBackend::kCpu;  // The CPU and GL backends produce byte-identical maps.
  options.grid = MapCollection::OptionsOf(team, /*self=*/0).grid;
  return options;
}

std::vector<AgentId> RoversOf(const proto::TeamConfig& team) {
  std::vector<AgentId> rovers;
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.kind() == proto::AGENT_KIND_ROVER) rovers.push_back(agent.id());
  }
  return rovers;
}

bool AreEqual(const MergedMap& a, const MergedMap& b) {
  return a.resolution_um == b.resolution_um && a.origin_cell_x == b.origin_cell_x &&
         a.origin_cell_y == b.origin_cell_y && a.grid == b.grid;
}

// Returns the true poses of the nodes in `known`.
Poses TruePoses(const Mission& mission, const Poses& known) {
  Poses poses;
  for (const auto& [node, pose] : known) {
    const auto found = mission.truth.find(node);
    if (found != mission.truth.end()) poses.emplace(node, found->second);
  }
  return poses;
}

// Returns the rovers' poses, moved in the plane to where they fit the truth best.
Poses AlignedRovers(Poses poses, const Poses& truth, AgentId base) {
  std::erase_if(poses, [base](const auto& entry) { return entry.first.agent == base; });
  const Pose truth_from_estimate = FindAlignment(poses, truth, /*is_planar=*/true);
  for (auto& [node, pose] : poses) pose = truth_from_estimate * pose;
  return poses;
}

// Returns nullopt if no match is held, or if the graph cannot be solved without matches.
std::optional<Poses> SolveWithoutMatches(const proto::TeamConfig& team, const Held& held) {
  PoseGraph graph = held.graph.graph();
  const auto is_match = [](const LoopClosure& closure) { return closure.source == kRegistrationSource; };
  if (std::erase_if(graph.closures, is_match) == 0) return std::nullopt;
  Solution solution = SolvePoseGraph(graph, FactsOf(team), {}, {});
  if (!solution.is_accepted) return std::nullopt;
  return std::move(solution.poses);
}

// Merges all maps of the mission at the true poses, as a team would that had lost no record.
Result<MergedMap> MergeMission(const proto::TeamConfig& team, const Mission& mission) {
  Held all;
  for (std::size_t place = 0; place < mission.maps.size(); ++place) {
    const MissionMap& map = mission.maps[place];
    auto read = ReadMissionMap(mission, map);
    if (!read) return tl::unexpected(read.error());
    const StreamKey stream{map.agent, /*epoch=*/1, proto::LOCAL_TRAVERSABILITY_MAP};
    all.maps.push_back({{stream, place + 1}, map.timestamp_ns, *std::move(read)});
  }
  return MergeAt(team, all, mission.truth);
}

// Returns the part of the cells known in `whole` that `map` knows too. Errors are those of CompareMaps.
Result<double> PartKnown(const MergedMap& map, const MergedMap& whole) {
  const auto agreement = CompareMaps(map, whole);
  if (!agreement) return tl::unexpected(agreement.error());
  const auto& cells = whole.grid.cells;
  const auto known = std::ssize(cells) - std::ranges::count(cells, Cell::kUnknown);
  return known == 0 ? 0 : static_cast<double>(agreement->known_in_both_count) / static_cast<double>(known);
}

}  // namespace

Result<Held> ReadHeld(Client& client, const proto::TeamConfig& team) {
  Held held;
  auto graph = ReadGraphOf(client, team);
  if (!graph) return tl::unexpected(graph.error());
  held.graph = std::move(*graph);
  proto::ReadRequest request;
  request.add_data_types(proto::LOCAL_TRAVERSABILITY_MAP);
  request.set_content_bytes_max(4 * 1024 * 1024);
  const auto read =
      client.ReadAll(request, [&held](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
        auto map = FromProto(record.local_traversability_map());
        if (!map) return tl::unexpected(map.error());
        held.maps.push_back({FromProto(stored.key()), record.timestamp_ns(), std::move(*map)});
        return {};
      });
  if (!read) return tl::unexpected(read.error());
  return held;
}

Poses RawPoses(const Held& held) { return PosesOf(held.graph.graph()); }

Result<MergedMap> MergeAt(const proto::TeamConfig& team, const Held& held, const Poses& poses, AgentId only) {
  std::vector<MapAtPose> maps;
  for (const HeldMap& map : held.maps) {
    const auto pose = poses.find(map.map.node);
    if (pose == poses.end() || (only != 0 && map.key.stream.origin != only)) continue;
    maps.push_back({map.key, map.timestamp_ns, pose->second, map.map});
  }
  const AgentId base = BaseStationOf(team);
  std::vector<Pose> footprints;
  for (const auto& [node, pose] : poses) {
    if (node.agent != base && (only == 0 || node.agent == only)) footprints.push_back(pose);
  }
  return MergeMaps(maps, footprints, OptionsOf(team));
}

Result<Scored> ScoreHeld(const proto::TeamConfig& team, const Mission& mission, const Held& held,
                         const MergedMap& agents_map, bool is_aligned) {
  const Poses raw = RawPoses(held);
  const Poses newest = held.graph.FindNewestPoses(held.graph.graph().nodes);
  const Poses truth = TruePoses(mission, raw);
  if (truth.empty()) return Fail(ErrorCode::kNotFound, "the agent holds no node of this mission");
  if (held.maps.empty())
    return Fail(ErrorCode::kNotFound,
                "the agent holds no map: score an agent that has received the maps, such as the leader");

  auto at_truth = MergeAt(team, held, truth);
  if (!at_truth) return tl::unexpected(at_truth.error());
  const auto score = [&](Poses poses) -> Result<ScoredPoses> {
    if (is_aligned) poses = AlignedRovers(std::move(poses), truth, BaseStationOf(team));
    auto map = MergeAt(team, held, poses);
    if (!map) return tl::unexpected(map.error());
    const auto agreement = CompareMaps(*map, *at_truth);
    if (!agreement) return tl::unexpected(agreement.error());
    return ScoredPoses{poses, CompareTrajectories(poses, truth, RoversOf(team)), *agreement, *std::move(map)};
  };
  auto before = score(raw);
  if (!before) return tl::unexpected(before.error());
  auto after = score(newest);
  if (!after) return tl::unexpected(after.error());

  Scored scored;
  const std::optional<Poses> solved = is_aligned ? std::nullopt : SolveWithoutMatches(team, held);
  if (solved) {
    auto without_matches = score(*solved);
    if (!without_matches) return tl::unexpected(without_matches.error());
    scored.without_matches = *std::move(without_matches);
  }
  scored.map_count = held.maps.size();
  scored.optimized_count = held.graph.published_count();
  if (is_aligned) {
    const auto merged = MergeAt(team, held, newest);
    if (!merged) return tl::unexpected(merged.error());
    scored.is_agents_map_equal = AreEqual(*merged, agents_map);
  } else {
    scored.is_agents_map_equal = AreEqual(after->map, agents_map);
  }
  const auto whole = MergeMission(team, mission);
  if (!whole) return tl::unexpected(whole.error());
  const auto area_ratio = PartKnown(after->map, *whole);
  if (!area_ratio) return tl::unexpected(area_ratio.error());
  scored.area_ratio = *area_ratio;
  scored.before = *std::move(before);
  scored.after = *std::move(after);
  scored.truth = *std::move(at_truth);
  return scored;
}

}  // namespace moondb
