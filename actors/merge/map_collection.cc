#include "actors/merge/map_collection.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "model/quarantined_maps.h"
#include "model/start_poses.h"
#include "model/term.h"

namespace moondb {

MapCollection::MapCollection(Options options)
    : options_(std::move(options)),
      map_quota_(options_.maps_max),
      map_bytes_quota_(options_.bytes_max),
      quarantines_(options_.quarantines_max),
      poses_(options_.nodes_max) {}

MapCollection::Options MapCollection::OptionsOf(const proto::TeamConfig& team, AgentId self) {
  Options options;
  options.grid.resolution_um = static_cast<std::uint32_t>(std::lround(team.map().resolution_m() * 1e6));
  if (team.map().footprint_m_size() == 2) {
    options.grid.footprint_length_m = team.map().footprint_m(0);
    options.grid.footprint_width_m = team.map().footprint_m(1);
  }
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.kind() == proto::AGENT_KIND_BASE_STATION) options.without_footprint.insert(agent.id());
  }
  options.self = self;
  options.with_start = KnownStarts(team);
  return options;
}

Result<void> MapCollection::Add(const RecordKey& key, const proto::Record& record) {
  switch (record.body_case()) {
    case proto::Record::kPoseGraphNode: {
      const proto::PoseGraphNode& node = record.pose_graph_node();
      const Result<Pose> pose = FromProto(node.map_from_node());
      if (!pose) return tl::unexpected(pose.error());
      AddRawPose(key, FromProto(node.node()), *pose, record.timestamp_ns());
      return {};
    }
    case proto::Record::kOptimizedPose:
      return AddOptimizedPose(key, record.optimized_pose());
    case proto::Record::kLocalTraversabilityMap: {
      const Result<TraversabilityMap> map = FromProto(record.local_traversability_map());
      if (!map) return tl::unexpected(map.error());
      return AddMap(key, {record.timestamp_ns(), record.is_clock_suspect()}, *map);
    }
    case proto::Record::kMapQuarantine:
      AddQuarantine(key, record.map_quarantine());
      return {};
    default:
      return {};
  }
}

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

void MapCollection::AddQuarantine(const RecordKey& key, const proto::MapQuarantine& quarantine) {
  if (!quarantines_.Add(key, quarantine)) return;
  quarantined_nodes_.reset();
  valid_.reset();
}

std::map<AgentId, std::uint64_t> MapCollection::CountLeftOut() const {
  std::map<AgentId, std::uint64_t> counts;
  map_quota_.CountLeftOut(counts);
  map_bytes_quota_.CountLeftOut(counts);
  quarantines_.CountLeftOut(counts);
  poses_.CountLeftOut(counts);
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
  if (!quarantined_nodes_) quarantined_nodes_ = quarantines_.FindNodes();
  return *quarantined_nodes_;
}

const NodePoses::ValidPoses& MapCollection::FindValid() const {
  if (!valid_) valid_ = poses_.FindValid(QuarantinedNodes());
  return *valid_;
}

MapCollection::Timestamp MapCollection::TimestampOf(const RecordKey& map) const {
  const auto found = maps_.find(map);
  return found == maps_.end() ? Timestamp() : found->second.timestamp;
}

const Pose* MapCollection::FindPose(const NodeKey& node, bool use_raw_poses) const {
  if (use_raw_poses) return poses_.FindRaw(node, QuarantinedNodes().contains(node));
  const ValidPose* pose = PoseOf(node);
  return pose == nullptr ? nullptr : &pose->map_from_node;
}

bool MapCollection::HasStart(AgentId agent) const {
  return !options_.with_start || options_.with_start->contains(agent) || options_.without_footprint.contains(agent);
}

bool MapCollection::IsPlaced(AgentId agent, bool use_raw_poses) const {
  return use_raw_poses ? HasStart(agent) : poses_.IsPlaced(agent).value_or(HasStart(agent));
}

bool MapCollection::IsPlaced(const NodeKey& node, bool use_raw_poses) const {
  const ValidPose* pose = use_raw_poses ? nullptr : PoseOf(node);
  if (pose != nullptr && pose->source != PoseSource::kRaw) return !pose->is_unplaced;
  return HasStart(node.agent) && IsPlaced(node.agent, use_raw_poses);
}

AgentId MapCollection::FrameOf(const Selection& selection) const {
  const bool is_of_self = selection.agents.empty();
  if (!is_of_self && selection.agents.size() != 1) return 0;
  const AgentId agent = is_of_self ? options_.self : *selection.agents.begin();
  const bool is_rover = poses_.HasNode(agent) && !options_.without_footprint.contains(agent);
  return is_rover && !IsPlaced(agent, selection.use_raw_poses) ? agent : 0;
}

MapCollection::Selected MapCollection::Select(const Selection& selection) const {
  Selected selected;
  selected.frame_of = FrameOf(selection);
  const auto is_selected = [&selection, &selected](AgentId agent) {
    if (selected.frame_of != 0) return agent == selected.frame_of;
    return selection.agents.empty() || selection.agents.contains(agent);
  };
  const auto is_placed = [&](const NodeKey& node) {
    return selected.frame_of != 0 || IsPlaced(node, selection.use_raw_poses);
  };
  std::vector<std::pair<NodeKey, Eigen::Vector3d>> positions_m;
  poses_.ForEach([&](const NodeKey& node) {
    if (!is_selected(node.agent)) return;
    const Pose* pose = FindPose(node, selection.use_raw_poses);
    if (pose == nullptr) return;
    if (is_placed(node)) {
      positions_m.emplace_back(node, pose->position_m);
    } else if (!options_.without_footprint.contains(node.agent)) {
      selected.unplaced[node.agent];
    }
  });
  selected.far_nodes = FindFarNodes(positions_m);
  if (!selection.use_raw_poses) {
    for (const auto& [agent, index] : FindValid().cut_at) {
      if (is_selected(agent)) selected.cut[agent] = {index};
    }
  }
  std::set<NodeKey> far;
  for (const FarNode& node : selected.far_nodes) far.insert(node.node);
  const QuarantinedMaps quarantined(quarantines_);
  for (const auto& [key, map] : maps_) {
    if (!is_selected(key.stream.origin)) continue;
    const NodeKey& node = map.local->node;
    const Pose* pose = FindPose(node, selection.use_raw_poses);
    const bool is_left_out =
        quarantined.Contains(map.local->agent(), map.timestamp.ns) || QuarantinedNodes().contains(node);
    if (is_left_out) {
      selected.quarantined_maps.push_back(map.local);
    } else if (pose == nullptr) {
      selected.waiting_maps.push_back(map.local);
      const auto cut = selected.cut.find(node.agent);
      if (cut != selected.cut.end() && node.index >= cut->second.first_index && poses_.FindRawRecord(node) != nullptr) {
        ++cut->second.map_count;
      }
    } else if (!is_placed(node)) {
      selected.waiting_maps.push_back(map.local);
      ++selected.unplaced[node.agent];
    } else if (!far.contains(node)) {
      selected.maps.push_back({map.local, *pose});
    }
  }
  poses_.ForEach([&](const NodeKey& node) {
    if (!is_selected(node.agent) || options_.without_footprint.contains(node.agent) || far.contains(node)) return;
    const NodePoses::RawPose* raw = poses_.FindRawRecord(node);
    const bool is_quarantined =
        raw == nullptr ? quarantined.ContainsAll(node.agent) : quarantined.Contains(node.agent, raw->timestamp_ns);
    const Pose* pose = is_quarantined || !is_placed(node) ? nullptr : FindPose(node, selection.use_raw_poses);
    if (pose != nullptr) selected.footprints.push_back({node, *pose, raw == nullptr ? RecordKey() : raw->key});
  });
  return selected;
}

}  // namespace moondb
