#include "actors/merge/map_collection.h"

#include <string>
#include <utility>

#include "model/term.h"

namespace moondb {
namespace {

std::uint64_t CountCells(const TraversabilityMap& map) {
  std::uint64_t count = 0;
  for (const MapLayer& layer : map.layers) count += layer.grid.cells.size();
  return count;
}

}  // namespace

Result<bool> MapCollection::PutMap(const RecordKey& key, std::int64_t stamp_ns, TraversabilityMap map) {
  if (maps_.contains(key)) return false;
  const std::uint64_t cells = CountCells(map);
  if (maps_.size() >= options_.maps_max || cells > options_.cells_max - cells_) {
    return Fail(ErrorCode::kFull, "merging holds at most " + std::to_string(options_.maps_max) + " maps and " +
                                      std::to_string(options_.cells_max) + " cells");
  }
  Result<std::shared_ptr<const LocalMap>> local = MakeLocalMap(key, stamp_ns, std::move(map), options_.grid);
  if (!local) return tl::unexpected(local.error());
  maps_.emplace(key, std::move(*local));
  cells_ += cells;
  return true;
}

bool MapCollection::WithdrawMap(const RecordKey& key) {
  const auto found = maps_.find(key);
  if (found == maps_.end()) return false;
  cells_ -= CountCells(found->second->map);
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

const Pose* MapCollection::FindPose(const NodeKey& node, bool use_raw_poses) const {
  const auto found = nodes_.find(node);
  if (found == nodes_.end()) return nullptr;
  const auto& [raw, optimized] = found->second;
  if (!use_raw_poses && optimized) return &optimized->second;
  return raw ? &raw->second : nullptr;
}

Result<MapCollection::Selected> MapCollection::Place(const Selection& selection) const {
  const auto is_selected = [&selection](AgentId agent) {
    return selection.agents.empty() || selection.agents.contains(agent);
  };
  Selected selected;
  std::vector<PlacedMap> maps;
  for (const auto& [key, map] : maps_) {
    if (!is_selected(key.stream.origin)) continue;
    const Pose* pose = FindPose(map->map.node, selection.use_raw_poses);
    if (pose == nullptr) {
      ++selected.waiting_map_count;
    } else {
      maps.push_back({map, *pose});
    }
  }
  std::vector<Pose> footprints;
  for (const auto& [node, poses] : nodes_) {
    if (!is_selected(node.agent) || options_.without_footprint.contains(node.agent)) continue;
    if (const Pose* pose = FindPose(node, selection.use_raw_poses)) footprints.push_back(*pose);
  }
  selected.node_count = footprints.size();
  Result<MapPlacement> placement = PlaceMaps(std::move(maps), footprints, options_.grid);
  if (!placement) return tl::unexpected(placement.error());
  selected.placement = std::move(*placement);
  return selected;
}

}  // namespace moondb
