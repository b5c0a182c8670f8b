#include "bench/naive_merger.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "bench/painted_layers.h"

namespace moondb {
namespace {

// Replaces `state` by `seen` if `seen` is better: finer, or newer at equal resolution. If resolution and time are
// equal, `seen` is better only if it is from another map than `state`. Requires: calls in order of the maps' record
// keys; within a map, from fine to coarse.
inline void Decide(const NaiveMerger::CellState& seen, NaiveMerger::CellState& state) {
  if (seen.resolution_um > state.resolution_um) return;
  if (seen.resolution_um == state.resolution_um) {
    if (seen.timestamp_ns < state.timestamp_ns) return;
    if (seen.timestamp_ns == state.timestamp_ns && state.map == seen.map) return;
  }
  state = seen;
}

}  // namespace

NaiveMerger::NaiveMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid)
    : grid_(grid), maps_(maps.begin(), maps.end()), footprints_(footprints.begin(), footprints.end()) {
  std::sort(maps_.begin(), maps_.end(), [](const auto& a, const auto& b) { return a.map->key < b.map->key; });
  for (const PlacedMap& placed : maps_) {
    std::vector<std::vector<Cell>>& blocks = block_cells_.emplace_back();
    for (const PackedBlock& packed : placed.map->blocks) blocks.push_back(UnpackCells(packed));
  }
}

void NaiveMerger::Merge(Arithmetic arithmetic) {
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
      if (arithmetic == Arithmetic::kDouble) {
        DrawBlockInDoubles(placed, block_cells_[i][block], static_cast<std::uint32_t>(i));
      } else {
        DrawBlock(placed, block_cells_[i][block], static_cast<std::uint32_t>(i));
      }
    }
  }
}

// Calls visit(state, column, row) for each cell of the merged map whose centre lies in the rectangle. `column` and
// `row` are the cell's coordinates within the rectangle.
template <typename Visit>
inline void NaiveMerger::ForEachCell(const PlacedRectangle& p, Visit visit) {
  for (std::int64_t y = p.box.first_y; y <= p.box.last_y; ++y) {
    CellState* row = cells_.data() + (y - extent_.first_y) * extent_.width() - extent_.first_x;
    for (std::int64_t x = p.box.first_x; x <= p.box.last_x; ++x) {
      const std::int64_t i = x - p.anchor_x;
      const std::int64_t j = y - p.anchor_y;
      const std::int64_t u = p.u0 + i * p.step_cos + j * p.step_sin;
      const std::int64_t v = p.v0 - i * p.step_sin + j * p.step_cos;
      if (u < 0 || v < 0 || u >= p.width_q || v >= p.height_q) continue;
      visit(row[x], u >> kFractionBits, v >> kFractionBits);
    }
  }
}

void NaiveMerger::DrawBlock(const PlacedBlock& placed, const std::vector<Cell>& cells, std::uint32_t map) {
  const LayerBlock& block = placed.cells->block();
  const std::uint32_t resolution_um = placed.resolution_um;
  const std::int64_t timestamp_ns = placed.timestamp_ns;
  ForEachCell(placed.rectangle, [&](CellState& state, std::int64_t column, std::int64_t row) {
    const Cell value = cells[static_cast<std::size_t>(row * block.width + column)];
    if (value != Cell::kUnknown) Decide({timestamp_ns, resolution_um, map, block.level, value}, state);
  });
}

void NaiveMerger::DrawBlockInDoubles(const PlacedBlock& placed, const std::vector<Cell>& cells, std::uint32_t map) {
  const LocalMap& local = *maps_[map].map;
  const LayerBlock& block = placed.cells->block();
  const LocalLayer& layer = local.layers[block.level];
  const PlanarPose pose = ToPlanar(maps_[map].map_from_node, local.node_from_map);
  const double grid_m = grid_.resolution_um / 1e6;
  const double cell_m = layer.resolution_um / 1e6;
  const CellBox& box = placed.rectangle.box;
  for (std::int64_t y = box.first_y; y <= box.last_y; ++y) {
    CellState* row = cells_.data() + (y - extent_.first_y) * extent_.width() - extent_.first_x;
    for (std::int64_t x = box.first_x; x <= box.last_x; ++x) {
      const double dx = (static_cast<double>(x) + 0.5) * grid_m - pose.x_m;
      const double dy = (static_cast<double>(y) + 0.5) * grid_m - pose.y_m;
      const double in_x_m = pose.cos_yaw * dx + pose.sin_yaw * dy - layer.center_x_m;
      const double in_y_m = pose.cos_yaw * dy - pose.sin_yaw * dx - layer.center_y_m;
      const auto column = static_cast<std::int32_t>(std::floor(in_x_m / cell_m + layer.width / 2.0)) - block.column;
      const auto in_row = static_cast<std::int32_t>(std::floor(in_y_m / cell_m + layer.height / 2.0)) - block.row;
      if (column < 0 || in_row < 0 || column >= block.width || in_row >= block.height) continue;
      const Cell value = cells[static_cast<std::size_t>(in_row) * block.width + column];
      if (value == Cell::kUnknown) continue;
      Decide({placed.timestamp_ns, placed.resolution_um, map, block.level, value}, row[x]);
    }
  }
}

void NaiveMerger::DrawFootprint(const PlacedRectangle& placed) {
  ForEachCell(placed, [](CellState& state, std::int64_t, std::int64_t) {
    state = {0, 0, UINT32_MAX, 255, Cell::kFree};
  });
}

}  // namespace moondb
