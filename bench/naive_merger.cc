#include "bench/naive_merger.h"

#include <algorithm>
#include <memory>

namespace moondb {
namespace {

std::vector<Cell> Unpack(const PackedBlock& packed) {
  std::vector<Cell> cells;
  for (std::int32_t row = 0; row < packed.block().height; ++row) {
    for (std::int32_t column = 0; column < packed.block().width; ++column) cells.push_back(packed.At(column, row));
  }
  return cells;
}

}  // namespace

NaiveMerger::NaiveMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid)
    : grid_(grid), maps_(maps.begin(), maps.end()), footprints_(footprints.begin(), footprints.end()) {
  std::sort(maps_.begin(), maps_.end(), [](const auto& a, const auto& b) { return a.map->key < b.map->key; });
  for (const PlacedMap& placed : maps_) {
    std::vector<std::vector<Cell>>& blocks = block_cells_.emplace_back();
    for (const PackedBlock& packed : placed.map->blocks) blocks.push_back(Unpack(packed));
  }
}

void NaiveMerger::Merge() {
  std::vector<std::unique_ptr<PlacedThing>> things;
  extent_ = {};
  for (const PlacedMap& placed : maps_) {
    things.push_back(*PlaceMap(placed, grid_));
    extent_.Add(things.back()->extent);
  }
  for (const Footprint& footprint : footprints_) {
    things.push_back(*PlaceFootprint(footprint, grid_));
    extent_.Add(things.back()->extent);
  }
  cells_.assign(static_cast<std::size_t>(extent_.width() * extent_.height()), CellState());
  for (std::size_t i = 0; i < things.size(); ++i) {
    for (const PlacedBlock& placed : things[i]->blocks) {
      if (placed.is_footprint()) {
        DrawFootprint(placed.rectangle);
        continue;
      }
      const auto block = static_cast<std::size_t>(placed.cells - maps_[i].map->blocks.data());
      DrawBlock(placed, block_cells_[i][block], static_cast<std::uint32_t>(i));
    }
  }
}

void NaiveMerger::DrawBlock(const PlacedBlock& placed, const std::vector<Cell>& cells, std::uint32_t map) {
  const PlacedRectangle& p = placed.rectangle;
  const LayerBlock& block = placed.cells->block();
  const std::uint32_t resolution_um = placed.resolution_um;
  const std::int64_t stamp_ns = placed.stamp_ns;
  for (std::int64_t y = p.box.first_y; y <= p.box.last_y; ++y) {
    CellState* row = cells_.data() + (y - extent_.first_y) * extent_.width() - extent_.first_x;
    for (std::int64_t x = p.box.first_x; x <= p.box.last_x; ++x) {
      const std::int64_t i = x - p.anchor_x;
      const std::int64_t j = y - p.anchor_y;
      const std::int64_t u = p.u0 + i * p.step_cos + j * p.step_sin;
      const std::int64_t v = p.v0 - i * p.step_sin + j * p.step_cos;
      if (u < 0 || v < 0 || u >= p.width_q || v >= p.height_q) continue;
      const Cell value = cells[static_cast<std::size_t>((v >> kFractionBits) * block.width + (u >> kFractionBits))];
      if (value == Cell::kUnknown) continue;
      CellState& state = row[x];
      // Maps come by rising record key, a map's layers from fine to coarse: of equals, the later map and the earlier
      // layer or block stand.
      if (resolution_um > state.resolution_um) continue;
      if (resolution_um == state.resolution_um) {
        if (stamp_ns < state.stamp_ns) continue;
        if (stamp_ns == state.stamp_ns && state.map == map) continue;
      }
      state = {stamp_ns, resolution_um, map, block.level, value};
    }
  }
}

void NaiveMerger::DrawFootprint(const PlacedRectangle& p) {
  for (std::int64_t y = p.box.first_y; y <= p.box.last_y; ++y) {
    CellState* row = cells_.data() + (y - extent_.first_y) * extent_.width() - extent_.first_x;
    for (std::int64_t x = p.box.first_x; x <= p.box.last_x; ++x) {
      const std::int64_t i = x - p.anchor_x;
      const std::int64_t j = y - p.anchor_y;
      const std::int64_t u = p.u0 + i * p.step_cos + j * p.step_sin;
      const std::int64_t v = p.v0 - i * p.step_sin + j * p.step_cos;
      if (u < 0 || v < 0 || u >= p.width_q || v >= p.height_q) continue;
      row[x] = {0, 0, UINT32_MAX, 255, Cell::kFree};
    }
  }
}

}  // namespace moondb
