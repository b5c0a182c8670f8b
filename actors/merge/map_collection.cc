#include "actors/merge/map_collection.h"

#include <algorithm>
#include <string>
#include <utility>

#include "model/term.h"

namespace moondb {

Result<bool> MapCollection::PutMap(const RecordKey& key, const Stamp& stamp, const TraversabilityMap& map) {
  if (maps_.contains(key)) return false;
  const std::int64_t stamp_ns = stamp.is_clock_suspect ? INT64_MIN : stamp.ns;
  Result<std::shared_ptr<const LocalMap>> local = MakeLocalMap(key, stamp_ns, map, options_.grid);
  if (!local) return tl::unexpected(local.error());
  const std::uint64_t bytes = (*local)->bytes();
  if (maps_.size() >= options_.maps_max || bytes > options_.bytes_max - bytes_) {
    return Fail(ErrorCode::kFull, "merging holds at most " + std::to_string(options_.maps_max) + " maps and " +
                                      std::to_string(options_.bytes_max) + " bytes");
  }
  maps_.emplace(key, HeldMap{std::move(*local), stamp});
  bytes_ += bytes;
  return true;
}

bool MapCollection::WithdrawMap(const RecordKey& key) {
  const auto found = maps_.find(key);
  if (found == maps_.end()) return false;
  bytes_ -= found->second.local->bytes();
  maps_.erase(found);
  return true;
}

Result<MapCollection::Node*> MapCollection::FindOrAddNode(const NodeKey& node) {
  const auto found = nodes_.find(node);
  if (found != nodes_.end()) return &found->second;
  if (nodes_.size() >= options_.nodes_max) {
    return Fail(ErrorCode::kFull, "merging holds at most " + std::to_string(options_.nodes_max) + " nodes");
  }
  return &nodes_[node];
}

Result<void> MapCollection::SetRawPose(const RecordKey& key, const NodeKey& node, const Pose& map_from_node) {
  Result<Node*> entry = FindOrAddNode(node);
  if (!entry) return tl::unexpected(entry.error());
  auto& raw = (*entry)->raw;
  if (!raw || key < raw->first) raw.emplace(key, map_from_node);
  return {};
}

Result<void> MapCollection::SetOptimizedPose(const RecordKey& key, const NodeKey& node, const Pose& map_from_node,
                                             const proto::Term& term, std::uint64_t run) {
  Result<Node*> entry = FindOrAddNode(node);
  if (!entry) return tl::unexpected(entry.error());
  auto& optimized = (*entry)->optimized;
  const Version version = std::tuple_cat(OrderOf(term), std::tuple(run, key));
  if (!optimized || version > optimized->first) optimized.emplace(version, map_from_node);
  return {};
}

Result<void> MapCollection::AddQuarantine(const RecordKey& key, const proto::MapQuarantine& quarantine) {
  if (quarantines_.contains(key)) return {};
  if (quarantines_.size() + lifted_.size() >= options_.quarantines_max) {
    return Fail(ErrorCode::kFull,
                "merging holds at most " + std::to_string(options_.quarantines_max) + " quarantines of maps");
  }
  if (quarantine.has_lifts()) {
    lifted_.insert(FromProto(quarantine.lifts()));
  } else {
    quarantines_.emplace(key, quarantine);
  }
  return {};
}

bool MapCollection::LeavesOut(const proto::MapQuarantine& quarantine, const HeldMap& map) {
  return quarantine.agent_id() == map.local->agent() && quarantine.from_ns() <= map.stamp.ns &&
         map.stamp.ns <= quarantine.to_ns();
}

std::vector<MapCollection::Quarantine> MapCollection::StandingQuarantines() const {
  std::vector<Quarantine> standing;
  for (const auto& [key, said] : quarantines_) {
    if (lifted_.contains(key)) continue;
    const auto left_out = std::count_if(maps_.begin(), maps_.end(),
                                        [&said = said](const auto& map) { return LeavesOut(said, map.second); });
    standing.push_back({key, said, static_cast<std::size_t>(left_out)});
  }
  return standing;
}

std::optional<MapCollection::NodePose> MapCollection::PoseOf(const NodeKey& node) const {
  const Pose* pose = FindPose(node, /*use_raw_poses=*/false);
  if (pose == nullptr) return std::nullopt;
  return NodePose{*pose, nodes_.at(node).optimized.has_value()};
}

MapCollection::Stamp MapCollection::StampOf(const RecordKey& map) const {
  const auto found = maps_.find(map);
  return found == maps_.end() ? Stamp() : found->second.stamp;
}

const Pose* MapCollection::FindPose(const NodeKey& node, bool use_raw_poses) const {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return nullptr;
  const auto& [raw, optimized] = found->second;
  if (!use_raw_poses && optimized) return &optimized->second;
  return raw ? &raw->second : nullptr;
}

MapCollection::Selected MapCollection::Select(const Selection& selection) const {
  const auto is_selected = [&selection](AgentId agent) {
    return selection.agents.empty() || selection.agents.contains(agent);
  };
  std::vector<const proto::MapQuarantine*> standing;
  for (const auto& [key, said] : quarantines_) {
    if (!lifted_.contains(key)) standing.push_back(&said);
  }
  Selected selected;
  for (const auto& [key, map] : maps_) {
    if (!is_selected(key.stream.origin)) continue;
    const Pose* pose = FindPose(map.local->node, selection.use_raw_poses);
    const bool is_left_out = std::any_of(standing.begin(), standing.end(),
                                         [&map = map](const auto* quarantine) { return LeavesOut(*quarantine, map); });
    if (is_left_out) {
      selected.quarantined_maps.push_back(map.local);
    } else if (pose == nullptr) {
      selected.waiting_maps.push_back(map.local);
    } else {
      selected.maps.push_back({map.local, *pose});
    }
  }
  for (const auto& [node, poses] : nodes_) {
    if (!is_selected(node.agent) || options_.without_footprint.contains(node.agent)) continue;
    if (const Pose* pose = FindPose(node, selection.use_raw_poses)) selected.footprints.push_back({node, *pose});
  }
  return selected;
}

}  // namespace moondb
