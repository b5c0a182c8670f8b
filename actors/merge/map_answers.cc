#include "actors/merge/map_answers.h"

#include <xxhash.h>
#include <zstd.h>
#include <zstd_errors.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "model/geometry.h"

namespace moondb {
namespace {

constexpr int kZstdLevel = 3;
constexpr std::size_t kTileHeadBytes = 24;  // Upper bound of a tile's encoded size without its cells.
constexpr std::int64_t kTilesInPageSide = kPageSideCells / kTileSideCells;

std::int64_t CellAt(double metres, std::uint32_t resolution_um) {
  return static_cast<std::int64_t>(std::floor(metres * 1e6 / resolution_um));
}

double CentreOf(std::int64_t cell, std::uint32_t resolution_um) {
  return (static_cast<double>(cell) + 0.5) * resolution_um * 1e-6;
}

void SetMap(const MapCollection& collection, const LocalMap& map, proto::MapObservation& said) {
  *said.mutable_record() = ToProto(map.key);
  *said.mutable_node() = ToProto(map.node);
  const MapCollection::Timestamp timestamp = collection.TimestampOf(map.key);
  said.set_timestamp_ns(timestamp.ns);
  said.set_is_clock_suspect(timestamp.is_clock_suspect);
}

void SetPose(const MapCollection& collection, const NodeKey& node, proto::MapObservation& said) {
  const ValidPose* pose = collection.PoseOf(node);
  if (pose == nullptr) return;
  *said.mutable_map_from_node() = ToProto(pose->map_from_node);
  said.set_is_pose_optimized(pose->source == PoseSource::kOptimized);
  said.set_is_pose_carried(pose->source == PoseSource::kCarried);
}

proto::MapObservation ToProto(const MapCollection& collection, const Observation& observation) {
  proto::MapObservation said;
  *said.mutable_node() = ToProto(observation.node);
  said.set_value(static_cast<std::uint32_t>(observation.cell));
  said.set_is_footprint(observation.placed.map == nullptr);
  if (observation.placed.map != nullptr) {
    SetMap(collection, *observation.placed.map, said);
    said.set_level(observation.level);
    said.set_resolution_um(observation.resolution_um);
  }
  SetPose(collection, observation.node, said);
  return said;
}

// Returns the observation that a quarantined map would contribute to the cell (x, y). Returns nullopt if the map does
// not know the cell or cannot be placed.
std::optional<proto::MapObservation> RequestQuarantined(const MapCollection& collection, const MergeGrid& grid,
                                                        const std::shared_ptr<const LocalMap>& map, std::int64_t x,
                                                        std::int64_t y) {
  const ValidPose* pose = collection.PoseOf(map->node);
  if (pose == nullptr) return std::nullopt;
  const Result<std::unique_ptr<PlacedThing>> placed = PlaceMap({map, pose->map_from_node}, grid);
  if (!placed) return std::nullopt;
  for (const PlacedBlock& block : (*placed)->blocks) {
    const Cell cell = CellUnder(block, x, y);
    if (cell == Cell::kUnknown) continue;
    proto::MapObservation said;
    SetMap(collection, *map, said);
    SetPose(collection, map->node, said);
    said.set_value(static_cast<std::uint32_t>(cell));
    said.set_level(block.cells->block().level);
    said.set_resolution_um(block.resolution_um);
    said.set_is_quarantined(true);
    return said;
  }
  return std::nullopt;
}

CellBox BoxOf(const proto::MapRegion& region, std::uint32_t resolution_um) {
  return {CellAt(region.x_min_m(), resolution_um), CellAt(region.y_min_m(), resolution_um),
          CellAt(region.x_max_m(), resolution_um), CellAt(region.y_max_m(), resolution_um)};
}

std::int64_t ColumnOf(const TileKey& key) { return key.page.x * kTilesInPageSide + key.tile % kTilesInPageSide; }
std::int64_t RowOf(const TileKey& key) { return key.page.y * kTilesInPageSide + key.tile / kTilesInPageSide; }

TileKey KeyOf(const proto::MapTile& tile) {
  const PageKey page = PageAt(tile.x() * kTileSideCells, tile.y() * kTileSideCells);
  const std::int64_t column = tile.x() - page.x * kTilesInPageSide;
  const std::int64_t row = tile.y() - page.y * kTilesInPageSide;
  return {page, static_cast<std::uint8_t>(row * kTilesInPageSide + column)};
}

std::uint64_t HashTile(const TileKey& key, const Grid& grid, std::uint64_t seed) {
  const std::array<std::int64_t, 2> place{ColumnOf(key), RowOf(key)};
  return XXH64(grid.cells.data(), grid.cells.size(), XXH64(place.data(), sizeof place, seed));
}

bool IsUnknown(const Grid& grid) {
  return std::all_of(grid.cells.begin(), grid.cells.end(), [](Cell cell) { return cell == Cell::kUnknown; });
}

}  // namespace

proto::MapWhyReply WhyOf(const MapCollection& collection, const Merger& merger, const proto::MapWhyRequest& request) {
  const std::uint32_t resolution_um = merger.grid().resolution_um;
  const std::int64_t x = CellAt(request.x_m(), resolution_um);
  const std::int64_t y = CellAt(request.y_m(), resolution_um);
  proto::MapWhyReply reply;
  reply.set_cell_x_m(CentreOf(x, resolution_um));
  reply.set_cell_y_m(CentreOf(y, resolution_um));
  const auto add = [&reply](proto::MapObservation said) {
    if (reply.observations_size() < kMapObservationsMax) {
      *reply.add_observations() = std::move(said);
    } else {
      reply.set_left_out_count(reply.left_out_count() + 1);
    }
  };
  // Maps already listed. If several layers of a map know the cell, only the finest layer is listed.
  std::set<RecordKey> heard;
  for (const Observation& observation : merger.Observe(x, y)) {
    if (observation.placed.map != nullptr && !heard.insert(observation.placed.map->key).second) continue;
    add(ToProto(collection, observation));
  }
  if (reply.observations_size() > 0) reply.set_value(reply.observations(0).value());
  for (const auto& map : collection.Select({}).quarantined_maps) {
    if (auto said = RequestQuarantined(collection, merger.grid(), map, x, y)) add(*std::move(said));
  }
  return reply;
}

proto::OccludedMapsReply OccludedMapsOf(const MapCollection& collection, const Merger& merger,
                                        std::uint32_t records_max) {
  const int count_max = static_cast<int>(std::min(records_max, kOccludedMapsMax));
  const std::vector<MapWins> all = merger.CountWins();
  // The next solve may move such a map, or place it in the frame `map`.
  const auto may_move = [&collection](const MapWins& wins) {
    const ValidPose* pose = collection.PoseOf(wins.placed.map->node);
    return pose == nullptr || pose->source != PoseSource::kOptimized || pose->is_unplaced;
  };
  std::set<TileKey> uncertain_tiles;
  for (const MapWins& wins : all) {
    if (!may_move(wins)) continue;
    ForEachTile(wins.extent, [&](const PageKey& page, std::size_t tile, const CellBox&) {
      uncertain_tiles.insert({page, static_cast<std::uint8_t>(tile)});
    });
  }
  proto::OccludedMapsReply reply;
  for (const MapWins& wins : all) {
    if (reply.records_size() >= count_max) break;
    if (wins.cells != 0 || wins.placed.map->key.seq == 0 || may_move(wins)) continue;
    bool may_reappear = false;
    ForEachTile(wins.extent, [&](const PageKey& page, std::size_t tile, const CellBox&) {
      may_reappear |= uncertain_tiles.contains({page, static_cast<std::uint8_t>(tile)});
    });
    if (!may_reappear) *reply.add_records() = ToProto(wins.placed.map->key);
  }
  return reply;
}

void AddCleared(const std::vector<ClearedHazards>& cleared, const MergeGrid& grid, proto::MapStatsReply& reply) {
  for (const ClearedHazards& found : cleared) {
    proto::ClearedHazards& added = *reply.add_cleared();
    added.set_agent_id(found.agent);
    added.set_cell_count(static_cast<double>(found.cell_count));
    added.set_hazard_count(static_cast<double>(found.hazard_count));
    added.set_from_ns(found.from_ns);
    added.set_to_ns(found.to_ns);
    added.set_x_m(CentreOf(found.cell_x, grid.resolution_um));
    added.set_y_m(CentreOf(found.cell_y, grid.resolution_um));
  }
}

void AddUnplaced(const MapCollection::Selected& selected,
                 google::protobuf::RepeatedPtrField<proto::UnplacedRover>& unplaced) {
  for (const auto& [agent, map_count] : selected.unplaced) {
    proto::UnplacedRover& rover = *unplaced.Add();
    rover.set_agent_id(agent);
    rover.set_map_count(static_cast<double>(map_count));
  }
}

void AddCut(const MapCollection::Selected& selected, google::protobuf::RepeatedPtrField<proto::CutRover>& cut) {
  for (const auto& [agent, of_agent] : selected.cut) {
    proto::CutRover& rover = *cut.Add();
    rover.set_agent_id(agent);
    rover.set_first_index(of_agent.first_index);
    rover.set_map_count(static_cast<double>(of_agent.map_count));
  }
}

proto::MapStatsReply StatsOf(const MapCollection& collection, const Merger& merger) {
  std::map<AgentId, proto::AgentMapStats> agents;
  for (const MapWins& wins : merger.CountWins()) {
    proto::AgentMapStats& stats = agents[wins.placed.map->agent()];
    stats.set_map_count(stats.map_count() + 1);
    if (wins.cells > 0) stats.set_winning_map_count(stats.winning_map_count() + 1);
    stats.set_won_cell_count(stats.won_cell_count() + static_cast<double>(wins.cells));
  }
  for (const auto& [agent, cells] : merger.CountFootprintCells()) {
    agents[agent].set_footprint_cell_count(static_cast<double>(cells));
  }
  const MapCollection::Selected selected = collection.Select({});
  for (const auto& map : selected.quarantined_maps) {
    proto::AgentMapStats& stats = agents[map->agent()];
    stats.set_quarantined_map_count(stats.quarantined_map_count() + 1);
  }
  for (const auto& map : selected.waiting_maps) {
    proto::AgentMapStats& stats = agents[map->agent()];
    stats.set_waiting_map_count(stats.waiting_map_count() + 1);
  }
  proto::MapStatsReply reply;
  AddFarNodes(selected.far_nodes, *reply.mutable_far_nodes());
  reply.set_far_node_count(static_cast<double>(selected.far_nodes.size()));
  reply.set_frame_of(selected.frame_of);
  AddUnplaced(selected, *reply.mutable_unplaced());
  AddCut(selected, *reply.mutable_cut());
  for (auto& [agent, stats] : agents) {
    stats.set_agent_id(agent);
    *reply.add_agents() = stats;
  }
  std::uint64_t hash = merger.grid().resolution_um;
  for (const TileKey& key : merger.ChangedSince(0)) {
    const Result<MergedMap> tile = merger.ReadCells(BoxOf(key.page, key.tile));
    if (!tile || IsUnknown(tile->grid)) continue;
    hash = HashTile(key, tile->grid, hash);
    const auto count = [&tile](Cell cell) {
      return static_cast<double>(std::count(tile->grid.cells.begin(), tile->grid.cells.end(), cell));
    };
    reply.set_free_cell_count(reply.free_cell_count() + count(Cell::kFree));
    reply.set_hazard_cell_count(reply.hazard_cell_count() + count(Cell::kHazard));
  }
  reply.set_cells_hash(hash);
  reply.set_resolution_um(merger.grid().resolution_um);
  reply.set_memory_bytes(static_cast<double>(collection.map_bytes() + merger.bytes()));
  for (const MapCollection::Quarantine& standing : collection.StandingQuarantines()) {
    proto::StandingQuarantine& added = *reply.add_quarantines();
    *added.mutable_record() = ToProto(standing.key);
    *added.mutable_quarantine() = standing.said;
    added.set_map_count(static_cast<double>(standing.map_count));
  }
  return reply;
}

Result<proto::MapTilesReply> ChangedTiles(const Merger& merger, std::uint64_t since_version,
                                          const proto::MapTilesRequest& request, std::size_t bytes_max) {
  std::vector<TileKey> keys = merger.ChangedSince(since_version);
  if (request.has_after()) keys.erase(keys.begin(), std::upper_bound(keys.begin(), keys.end(), KeyOf(request.after())));
  proto::MapTilesReply reply;
  reply.set_version(merger.version());
  reply.set_resolution_um(merger.grid().resolution_um);
  reply.set_tile_cells(static_cast<std::uint32_t>(kTileSideCells));
  reply.set_is_complete(true);
  std::size_t bytes = 0;
  for (const TileKey& key : keys) {
    const CellBox box = BoxOf(key.page, key.tile);
    if (request.has_region() && !box.Touches(BoxOf(request.region(), merger.grid().resolution_um))) continue;
    if (bytes >= bytes_max || reply.tiles_size() >= kMapTilesMax) {
      reply.set_is_complete(false);
      break;
    }
    const Result<MergedMap> cells = merger.ReadCells(box);
    if (!cells) return tl::unexpected(cells.error());
    const bool is_unknown = IsUnknown(cells->grid);
    // A client that starts at version 0 has no tiles yet. Skip tiles without a known cell.
    if (is_unknown && since_version == 0) continue;
    proto::MapTile& tile = *reply.add_tiles();
    tile.set_x(ColumnOf(key));
    tile.set_y(RowOf(key));
    bytes += kTileHeadBytes;
    if (is_unknown) continue;
    Result<std::string> coded = CompressCells(cells->grid, ZSTD_compressBound(kCellsInTile));
    if (!coded) return tl::unexpected(coded.error());
    bytes += coded->size();
    tile.set_zstd_cells(*std::move(coded));
  }
  return reply;
}

void AddLeftOut(const Merger& merger, const Crop& crop, proto::MergeReply& reply) {
  std::map<AgentId, proto::LeftOutItems> agents;
  for (const auto& [agent, left_out] : crop.left_out) {
    agents[agent].set_far_count(static_cast<double>(left_out.count));
    agents[agent].set_distance_m(static_cast<double>(left_out.distance_cells) * merger.grid().resolution_um * 1e-6);
  }
  for (const auto& [agent, count] : merger.CountWithoutRoom()) {
    agents[agent].set_without_room_count(static_cast<double>(count));
  }
  for (auto& [agent, items] : agents) {
    items.set_agent_id(agent);
    *reply.add_left_out() = items;
  }
}

Result<std::string> CompressCells(const Grid& grid, std::size_t bytes_max) {
  std::string compressed(std::min(ZSTD_compressBound(grid.cells.size()), bytes_max), '\0');
  const std::size_t size =
      ZSTD_compress(compressed.data(), compressed.size(), grid.cells.data(), grid.cells.size(), kZstdLevel);
  if (ZSTD_getErrorCode(size) == ZSTD_error_dstSize_tooSmall) {
    return Fail(ErrorCode::kFull, "the merged map takes more than " + std::to_string(bytes_max) +
                                      " bytes, the most that a reply holds: merge fewer agents");
  }
  if (ZSTD_isError(size) != 0) return Fail(ErrorCode::kInternal, std::string("zstd: ") + ZSTD_getErrorName(size));
  compressed.resize(size);
  return compressed;
}

}  // namespace moondb
