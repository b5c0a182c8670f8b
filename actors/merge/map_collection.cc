#include "actors/merge/map_collection.h"

#include <algorithm>
#include <string>
#include <utility>

#include "model/quarantined_maps.h"
#include "model/term.h"

namespace moondb {

MapCollection::MapCollection(Options options)
    : options_(std::move(options)),
      map_quota_(options_.maps_max),
      map_bytes_quota_(options_.bytes_max),
      quarantines_(options_.quarantines_max),
      node_quota_(options_.nodes_max) {}

Result<void> MapCollection::AddMap(const RecordKey& key, const Timestamp& timestamp, const TraversabilityMap& map) {
  if (maps_.contains(key)) return {};
  const std::int64_t timestamp_ns = timestamp.is_clock_suspect ? INT64_MIN : timestamp.ns;
  Result<std::shared_ptr<const LocalMap>> local = MakeLocalMap(key, timestamp_ns, map, options_.grid);
  if (!local) return tl::unexpected(local.error());
  const std::uint64_t bytes = (*local)->bytes();
  maps_.emplace(key, HeldMap{std::move(*local), timestamp});
  bytes_ += bytes;
  for (const auto& removed : map_quota_.Add(key, 1, {})) RemoveMap(removed.key);
  for (const auto& removed : map_bytes_quota_.Add(key, bytes, {})) RemoveMap(removed.key);
  return {};
}

void MapCollection::RemoveMap(const RecordKey& key) {
  const auto map = maps_.find(key);
  if (map == maps_.end()) return;  // The other quota has already removed the map.
  bytes_ -= map->second.local->bytes();
  maps_.erase(map);
}

void MapCollection::AddRawPose(const RecordKey& key, const NodeKey& node, const Pose& map_from_node) {
  auto& raw = nodes_[node].raw;
  const auto place =
      std::lower_bound(raw.begin(), raw.end(), key, [](const auto& a, const RecordKey& b) { return a.first < b; });
  if (place != raw.end() && place->first == key) return;
  raw.emplace(place, key, map_from_node);
  for (const auto& removed : node_quota_.Add(key, 1, node)) RemoveRawPose(removed.key, removed.note);
}

void MapCollection::RemoveRawPose(const RecordKey& key, const NodeKey& node) {
  const auto found = nodes_.find(node);
  std::erase_if(found->second.raw, [&key](const auto& raw) { return raw.first == key; });
  if (found->second.raw.empty() && !found->second.optimized) nodes_.erase(found);
}

void MapCollection::AddOptimizedPose(const RecordKey& key, const NodeKey& node, const Pose& map_from_node,
                                     const proto::Term& term, std::uint64_t run, bool ignores_raw_pose) {
  const auto found = nodes_.find(node);
  const bool is_first = found == nodes_.end() || !found->second.optimized;
  if (is_first && optimized_count_ >= options_.nodes_max) {
    ++left_out_pose_count_[key.stream.origin];
    return;
  }
  optimized_count_ += is_first ? 1 : 0;
  auto& optimized = nodes_[node].optimized;
  const Version version = std::tuple_cat(OrderOf(term), std::tuple(run, key));
  if (!optimized || version > optimized->version) optimized = {version, map_from_node, ignores_raw_pose};
}

void MapCollection::AddQuarantine(const RecordKey& key, const proto::MapQuarantine& quarantine) {
  if (quarantines_.Add(key, quarantine)) quarantined_nodes_.reset();
}

std::map<AgentId, std::uint64_t> MapCollection::CountLeftOut() const {
  std::map<AgentId, std::uint64_t> counts = left_out_pose_count_;
  map_quota_.CountLeftOut(counts);
  map_bytes_quota_.CountLeftOut(counts);
  quarantines_.CountLeftOut(counts);
  node_quota_.CountLeftOut(counts);
  return counts;
}

std::vector<MapCollection::Quarantine> MapCollection::StandingQuarantines() const {
  std::map<AgentId, std::vector<std::int64_t>> timestamps;
  std::map<NodeKey, std::size_t> map_counts;
  for (const auto& [key, map] : maps_) {
    timestamps[map.local->agent()].push_back(map.timestamp.ns);
    ++map_counts[map.local->node];
  }
  for (auto& [agent, of_agent] : timestamps) std::sort(of_agent.begin(), of_agent.end());
  std::vector<Quarantine> standing;
  quarantines_.ForEach([&](const RecordKey& key, const proto::MapQuarantine& said) {
    if (said.graph_part_case() != proto::MapQuarantine::GRAPH_PART_NOT_SET) {
      const auto count = said.has_node() ? map_counts.find(FromProto(said.node())) : map_counts.end();
      standing.push_back({key, said, count == map_counts.end() ? 0 : count->second});
      return;
    }
    const std::vector<std::int64_t>& of_agent = timestamps[said.agent_id()];
    const auto first = std::lower_bound(of_agent.begin(), of_agent.end(), said.from_ns());
    const auto last = std::upper_bound(of_agent.begin(), of_agent.end(), said.to_ns());
    standing.push_back({key, said, static_cast<std::size_t>(std::max<std::ptrdiff_t>(last - first, 0))});
  });
  return standing;
}

const std::set<NodeKey>& MapCollection::QuarantinedNodes() const {
  if (!quarantined_nodes_) {
    quarantined_nodes_.emplace();
    quarantines_.ForEach([this](const RecordKey&, const proto::MapQuarantine& said) {
      if (said.has_node()) quarantined_nodes_->insert(FromProto(said.node()));
    });
  }
  return *quarantined_nodes_;
}

std::optional<MapCollection::NodePose> MapCollection::PoseOf(const NodeKey& node) const {
  const Pose* pose = FindPose(node, /*use_raw_poses=*/false);
  if (pose == nullptr) return std::nullopt;
  return NodePose{*pose, nodes_.at(node).optimized.has_value()};
}

MapCollection::Timestamp MapCollection::TimestampOf(const RecordKey& map) const {
  const auto found = maps_.find(map);
  return found == maps_.end() ? Timestamp() : found->second.timestamp;
}

const Pose* MapCollection::FindPose(const NodeKey& node, bool use_raw_poses) const {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return nullptr;
  const auto& [raw, optimized] = found->second;
  if (QuarantinedNodes().contains(node)) {
    return !use_raw_poses && optimized && optimized->ignores_raw_pose ? &optimized->map_from_node : nullptr;
  }
  if (!use_raw_poses && optimized) return &optimized->map_from_node;
  return raw.empty() ? nullptr : &raw.front().second;
}

std::vector<std::pair<NodeKey, Eigen::Vector3d>> MapCollection::PositionsOf(const Selection& selection) const {
  std::vector<std::pair<NodeKey, Eigen::Vector3d>> positions_m;
  for (const auto& [node, poses] : nodes_) {
    if (!selection.agents.empty() && !selection.agents.contains(node.agent)) continue;
    if (const Pose* pose = FindPose(node, selection.use_raw_poses)) positions_m.emplace_back(node, pose->position_m);
  }
  return positions_m;
}

MapCollection::Selected MapCollection::Select(const Selection& selection) const {
  const auto is_selected = [&selection](AgentId agent) {
    return selection.agents.empty() || selection.agents.contains(agent);
  };
  const QuarantinedMaps quarantined(quarantines_);
  Selected selected;
  selected.far_nodes = FindFarNodes(PositionsOf(selection));
  std::set<NodeKey> far;
  for (const FarNode& node : selected.far_nodes) far.insert(node.node);
  for (const auto& [key, map] : maps_) {
    if (!is_selected(key.stream.origin)) continue;
    const Pose* pose = FindPose(map.local->node, selection.use_raw_poses);
    const bool is_left_out =
        quarantined.Contains(map.local->agent(), map.timestamp.ns) || QuarantinedNodes().contains(map.local->node);
    if (is_left_out) {
      selected.quarantined_maps.push_back(map.local);
    } else if (pose == nullptr) {
      selected.waiting_maps.push_back(map.local);
    } else if (!far.contains(map.local->node)) {
      selected.maps.push_back({map.local, *pose});
    }
  }
  for (const auto& [node, poses] : nodes_) {
    if (!is_selected(node.agent) || options_.without_footprint.contains(node.agent) || far.contains(node)) continue;
    if (const Pose* pose = FindPose(node, selection.use_raw_poses)) selected.footprints.push_back({node, *pose});
  }
  return selected;
}

}  // namespace moondb
