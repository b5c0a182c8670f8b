#include "actors/registration/known_maps.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "model/quarantined_maps.h"
#include "model/traversability_map.h"

namespace moondb {
namespace {

constexpr std::int64_t kNear_ns = 30'000'000'000;

}  // namespace

KnownMaps::KnownMaps(Options options)
    : options_(std::move(options)),
      map_quota_(options_.maps_max),
      bytes_quota_(options_.bytes_max),
      poses_(options_.nodes_max),
      tracks_(options_.nodes_max),
      quarantines_(options_.quarantines_max) {}

Result<void> KnownMaps::Add(const RecordKey& key, const proto::Record& record) {
  switch (record.body_case()) {
    case proto::Record::kPoseGraphEdge:
      tracks_.Add(key, record);
      return {};
    case proto::Record::kPoseGraphNode: {
      tracks_.Add(key, record);
      const NodeKey node = FromProto(record.pose_graph_node().node());
      if (!options_.rovers.contains(node.agent) || node_time_count_ >= options_.nodes_max) return {};
      if (node_times_[node.agent].try_emplace(record.timestamp_ns(), node).second) ++node_time_count_;
      return {};
    }
    case proto::Record::kOptimizedPose:
      return poses_.AddOptimized(key, record.optimized_pose());
    case proto::Record::kLocalTraversabilityMap:
      return AddMap(key, record);
    case proto::Record::kMapMatch:
      return AddMatch(key, record);
    case proto::Record::kMapQuarantine:
      quarantines_.Add(key, record.map_quarantine());
      return {};
    default:
      return {};
  }
}

Result<void> KnownMaps::AddMap(const RecordKey& key, const proto::Record& record) {
  if (maps_.contains(key)) return {};
  const Result<TraversabilityMap> map = FromProto(record.local_traversability_map());
  if (!map) return tl::unexpected(map.error());
  HeldMap held{record.local_traversability_map(), map->node, map->node_from_map, record.timestamp_ns()};
  auto& layers = *held.packed.mutable_layers();
  layers.erase(std::remove_if(
                   layers.begin(), layers.end(),
                   [](const proto::MapLayer& layer) { return layer.resolution_um() > HazardField::kCoarsestLayer_um; }),
               layers.end());
  held.bytes = held.packed.SpaceUsedLong();
  const std::uint64_t bytes = held.bytes;
  maps_.emplace(key, std::move(held));
  for (const auto& removed : map_quota_.Add(key, 1, {})) RemoveMap(removed.key);
  for (const auto& removed : bytes_quota_.Add(key, bytes, {})) RemoveMap(removed.key);
  return {};
}

Result<void> KnownMaps::AddMatch(const RecordKey& key, const proto::Record& record) {
  PoseGraph graph;
  if (Result<void> added = AddRecord(record, graph); !added) return added;
  const proto::MapMatch& body = record.map_match();
  std::uint64_t& last_run = last_runs_[OrderOf(body.term())];
  last_run = std::max(last_run, body.run());
  const std::pair ends(FromProto(body.from()), FromProto(body.to()));
  const auto version = [](const Match& match) {
    return std::tuple(OrderOf(match.body.term()), match.body.run(), match.key);
  };
  Match match{key, body, graph.closures.front()};
  const auto found = matches_.find(ends);
  if (found != matches_.end()) {
    if (version(found->second) < version(match)) found->second = std::move(match);
  } else if (matches_.size() < options_.matches_max) {
    matches_.emplace(ends, std::move(match));
  } else {
    ++left_out_matches_[key.stream.origin];
  }
  return {};
}

std::vector<RegisteredMap> KnownMaps::FindRegistered(std::size_t* unposed_count) const {
  const QuarantinedMaps quarantined_maps(quarantines_);
  const std::set<NodeKey> quarantined_nodes = quarantines_.FindNodes();
  std::vector<RegisteredMap> registered;
  for (const auto& [key, map] : maps_) {
    if (quarantined_nodes.contains(map.node) || quarantined_maps.Contains(key.stream.origin, map.timestamp_ns))
      continue;
    const NodePoses::OptimizedPose* pose = poses_.FindOptimized(map.node, /*is_quarantined=*/false);
    if (pose == nullptr) {
      if (unposed_count != nullptr) ++*unposed_count;
      continue;
    }
    const Pose& map_from_node = pose->map_from_node;
    registered.push_back({key, map.node, map.timestamp_ns, map_from_node, map_from_node * map.node_from_map});
  }
  return registered;
}

std::optional<TraversabilityMap> KnownMaps::FindMap(const RecordKey& key) const {
  const auto found = maps_.find(key);
  if (found == maps_.end()) return std::nullopt;
  Result<TraversabilityMap> map = FromProto(found->second.packed);
  if (!map) return std::nullopt;
  return *std::move(map);
}

std::vector<MaskedDisc> KnownMaps::FindRovers(const RegisteredMap& map, const std::set<AgentId>* in_frame) const {
  const Pose local_from_map = PlanarOffset::From(map.map_from_local).ToPose().Inverse();
  std::vector<MaskedDisc> discs;
  for (const auto& [agent, times] : node_times_) {
    if (agent == map.node.agent || (in_frame != nullptr && !in_frame->contains(agent))) continue;
    auto nearest = times.lower_bound(map.timestamp_ns);
    if (nearest == times.end() || (nearest != times.begin() &&
                                   map.timestamp_ns - std::prev(nearest)->first < nearest->first - map.timestamp_ns)) {
      --nearest;
    }
    if (std::abs(nearest->first - map.timestamp_ns) > kNear_ns) continue;
    const NodePoses::OptimizedPose* pose = poses_.FindOptimized(nearest->second, /*is_quarantined=*/false);
    if (pose == nullptr) continue;
    discs.push_back({(local_from_map * pose->map_from_node.position_m).head<2>(), options_.body_radius_m});
  }
  return discs;
}

const KnownMaps::Match* KnownMaps::FindMatch(const NodeKey& from, const NodeKey& to) const {
  const auto found = matches_.find({from, to});
  return found == matches_.end() ? nullptr : &found->second;
}

std::set<std::pair<AgentId, AgentId>> KnownMaps::FindMatched() const {
  std::set<std::pair<AgentId, AgentId>> matched;
  for (const auto& [nodes, match] : matches_) matched.insert(std::minmax(nodes.first.agent, nodes.second.agent));
  return matched;
}

std::uint64_t KnownMaps::LastRun(const proto::Term& term) const {
  const auto found = last_runs_.find(OrderOf(term));
  return found == last_runs_.end() ? 0 : found->second;
}

std::size_t KnownMaps::CountMatchesOfRemovedMaps() const {
  return static_cast<std::size_t>(std::ranges::count_if(matches_, [this](const auto& entry) {
    const proto::MapMatch& match = entry.second.body;
    return !maps_.contains(FromProto(match.from_map())) || !maps_.contains(FromProto(match.to_map()));
  }));
}

std::map<AgentId, std::uint64_t> KnownMaps::CountLeftOut() const {
  std::map<AgentId, std::uint64_t> counts = left_out_matches_;
  map_quota_.CountLeftOut(counts);
  bytes_quota_.CountLeftOut(counts);
  quarantines_.CountLeftOut(counts);
  poses_.CountLeftOut(counts);
  tracks_.CountLeftOut(counts);
  return counts;
}

}  // namespace moondb
