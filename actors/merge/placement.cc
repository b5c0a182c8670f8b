#include "actors/merge/placement.h"

#include <algorithm>
#include <string>
#include <tuple>
#include <utility>

namespace moondb {
namespace {

bool HasKnownCell(const Grid& grid, const LayerBlock& block) {
  for (std::int32_t row = block.row; row < block.row + block.height; ++row) {
    const auto begin = grid.cells.begin() + static_cast<std::ptrdiff_t>(row) * grid.width + block.column;
    if (std::any_of(begin, begin + block.width, [](Cell cell) { return cell != Cell::kUnknown; })) return true;
  }
  return false;
}

// Start and length of the pieces of one side.
std::vector<std::pair<std::int32_t, std::int32_t>> SplitSide(std::int32_t cells) {
  std::vector<std::pair<std::int32_t, std::int32_t>> pieces;
  for (std::int32_t start = 0; cells > 0; start += kBlockSideCellsMax - 1) {
    const std::int32_t length = std::min(kBlockSideCellsMax, cells - start);
    pieces.emplace_back(start, length);
    if (start + length == cells) break;
  }
  return pieces;
}

void AddBlocks(LocalMap& map, std::uint8_t level) {
  const Grid& grid = map.map.layers[level].grid;
  for (const auto& [row, height] : SplitSide(grid.height)) {
    for (const auto& [column, width] : SplitSide(grid.width)) {
      const LayerBlock block{level, column, row, width, height};
      map.bounds.push_back(block);
      if (HasKnownCell(grid, block)) map.blocks.push_back(block);
    }
  }
}

PlacedRectangle PlaceBlock(const PlanarPose& pose, const MapLayer& layer, const LayerBlock& block,
                           std::uint32_t grid_um) {
  const double cell_m = static_cast<double>(layer.resolution_um) / 1e6;
  const double x_cells = block.column + (block.width - layer.grid.width) / 2.0;
  const double y_cells = block.row + (block.height - layer.grid.height) / 2.0;
  return Quantize(pose, layer.center_x_m + x_cells * cell_m, layer.center_y_m + y_cells * cell_m, block.width,
                  block.height, layer.resolution_um, grid_um);
}

void SortByKey(MapPlacement& placement) {
  const auto order = [&placement](const PlacedBlock& a, const PlacedBlock& b) {
    const LocalMap& map_a = *placement.slots[a.slot].map;
    const LocalMap& map_b = *placement.slots[b.slot].map;
    // Slots are sorted by record key, and a record key begins with its agent.
    return std::tuple(map_a.map.layers[a.block.level].resolution_um, map_b.stamp_ns, b.slot, a.block.level, a.block.row,
                      a.block.column) < std::tuple(map_b.map.layers[b.block.level].resolution_um, map_a.stamp_ns,
                                                   a.slot, b.block.level, b.block.row, b.block.column);
  };
  std::sort(placement.blocks.begin(), placement.blocks.end(), order);
}

Result<void> CheckExtent(const CellBox& extent, const MergeGrid& grid) {
  if (extent.width() <= grid.side_cells_max && extent.height() <= grid.side_cells_max) return {};
  return Fail(ErrorCode::kFull, "the maps span " + std::to_string(extent.width()) + " x " +
                                    std::to_string(extent.height()) + " cells of " +
                                    std::to_string(grid.resolution_um) + " um; a merged map holds at most " +
                                    std::to_string(grid.side_cells_max) + " a side: merge fewer agents or coarser");
}

void PlaceMap(const PlacedMap& placed, std::uint16_t slot, std::uint32_t grid_um, MapPlacement& placement) {
  const PlanarPose pose = ToPlanar(placed.map_from_node, placed.map->map.node_from_map);
  const auto place = [&](const LayerBlock& block) {
    return PlaceBlock(pose, placed.map->map.layers[block.level], block, grid_um);
  };
  for (const LayerBlock& block : placed.map->bounds) placement.extent.Add(place(block).box);
  for (const LayerBlock& block : placed.map->blocks) {
    const PlacedRectangle rectangle = place(block);
    if (!rectangle.box.is_empty()) placement.blocks.push_back({rectangle, block, slot});
  }
}

void PlaceFootprint(const Pose& map_from_node, const MergeGrid& grid, MapPlacement& placement) {
  const double length_cells = grid.footprint_length_m * 1e6 / grid.resolution_um;
  const double width_cells = grid.footprint_width_m * 1e6 / grid.resolution_um;
  const PlacedRectangle rectangle =
      Quantize(ToPlanar(map_from_node), 0, 0, length_cells, width_cells, grid.resolution_um, grid.resolution_um);
  if (rectangle.box.is_empty()) return;
  placement.extent.Add(rectangle.box);
  placement.footprints.push_back(rectangle);
}

bool IsFootprintSide(double side_m, const MergeGrid& grid) {
  return side_m >= 0 && side_m * 1e6 / grid.resolution_um <= kBlockSideCellsMax;  // False for NaN.
}

}  // namespace

Result<void> CheckGrid(const MergeGrid& grid) {
  if (grid.resolution_um < 1000 || grid.resolution_um > kMapResolutionUmMax) {
    return Fail(ErrorCode::kInvalid, "must lie between 1 mm and 100 m", "map.resolution_m");
  }
  if (!IsFootprintSide(grid.footprint_length_m, grid) || !IsFootprintSide(grid.footprint_width_m, grid)) {
    return Fail(ErrorCode::kInvalid,
                "must lie between 0 and " + std::to_string(kBlockSideCellsMax) + " cells of the merged map",
                "map.footprint_m");
  }
  if (grid.side_cells_max < 1 || grid.side_cells_max > 65536) {
    return Fail(ErrorCode::kInvalid, "must lie between 1 and 65536", "side_cells_max");
  }
  return {};
}

Result<std::shared_ptr<const LocalMap>> MakeLocalMap(const RecordKey& key, std::int64_t stamp_ns, TraversabilityMap map,
                                                     const MergeGrid& grid) {
  auto local = std::make_shared<LocalMap>();
  local->key = key;
  local->stamp_ns = stamp_ns;
  local->map = std::move(map);
  for (std::size_t level = 0; level < local->map.layers.size(); ++level) {
    const std::uint64_t finest_um = local->map.layers[level].resolution_um;
    if (finest_um == 0 || finest_um * kStepCellsMax < grid.resolution_um) {
      return Fail(ErrorCode::kInvalid,
                  "cells of " + std::to_string(finest_um) + " um are too fine for a merged map of " +
                      std::to_string(grid.resolution_um) + " um",
                  "layers[" + std::to_string(level) + "].resolution_um");
    }
    AddBlocks(*local, static_cast<std::uint8_t>(level));
  }
  return local;
}

Result<MapPlacement> PlaceMaps(std::vector<PlacedMap> maps, std::span<const Pose> footprints, const MergeGrid& grid) {
  if (Result<void> checked = CheckGrid(grid); !checked) return tl::unexpected(checked.error());
  std::stable_sort(maps.begin(), maps.end(),
                   [](const PlacedMap& a, const PlacedMap& b) { return a.map->key < b.map->key; });
  const auto is_same = [](const PlacedMap& a, const PlacedMap& b) { return a.map->key == b.map->key; };
  maps.erase(std::unique(maps.begin(), maps.end(), is_same), maps.end());
  if (maps.size() > kPlacedMapsMax) {
    return Fail(ErrorCode::kFull, std::to_string(maps.size()) + " maps; one merge takes at most " +
                                      std::to_string(kPlacedMapsMax) + ": merge fewer agents");
  }
  MapPlacement placement;
  placement.resolution_um = grid.resolution_um;
  placement.slots = std::move(maps);
  for (std::size_t slot = 0; slot < placement.slots.size(); ++slot) {
    PlaceMap(placement.slots[slot], static_cast<std::uint16_t>(slot), grid.resolution_um, placement);
  }
  for (const Pose& map_from_node : footprints) PlaceFootprint(map_from_node, grid, placement);
  if (Result<void> checked = CheckExtent(placement.extent, grid); !checked) return tl::unexpected(checked.error());
  SortByKey(placement);
  return placement;
}

}  // namespace moondb
