#include "actors/merge/local_map.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <utility>

namespace moondb {
namespace {

// Packs up to 16 one-byte cells into one word. If `count` is less than 16, the missing cells are unknown.
std::uint32_t PackCellsOfWord(const Cell* cells, std::int32_t count) {
  std::array<std::uint8_t, kStripColumns> bytes{};
  std::memcpy(bytes.data(), cells, static_cast<std::size_t>(count));
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) word |= static_cast<std::uint32_t>(bytes[i]) << (2 * i);
  return word;
}

bool HasKnownCell(const Grid& grid, const LayerBlock& block) {
  for (std::int32_t row = block.row; row < block.row + block.height; ++row) {
    const Cell* begin = grid.cells.data() + static_cast<std::size_t>(row) * grid.width + block.column;
    if (std::any_of(begin, begin + block.width, [](Cell cell) { return cell != Cell::kUnknown; })) return true;
  }
  return false;
}

// Splits a side of `cells` cells into blocks. Returns the start and the length of each block.
std::vector<std::pair<std::int32_t, std::int32_t>> SplitSide(std::int32_t cells) {
  std::vector<std::pair<std::int32_t, std::int32_t>> pieces;
  for (std::int32_t start = 0; cells > 0; start += kBlockSideCellsMax - 1) {
    const std::int32_t length = std::min(kBlockSideCellsMax, cells - start);
    pieces.emplace_back(start, length);
    if (start + length == cells) break;
  }
  return pieces;
}

void AddBlocks(const Grid& grid, std::uint8_t level, std::int32_t reach_cells, LocalMap& map) {
  for (const auto& [row, height] : SplitSide(grid.height)) {
    for (const auto& [column, width] : SplitSide(grid.width)) {
      const LayerBlock block{level, column, row, width, height};
      map.bounds.push_back(block);
      if (HasKnownCell(grid, block)) map.blocks.emplace_back(grid, block, reach_cells);
    }
  }
}

// Returns an upper bound on the distance, along either axis, between two layer cells that one 8 x 8 square of the
// merged map reads, at any rotation. Unit: layer cells.
std::int32_t ReachCells(std::uint32_t layer_um, std::uint32_t grid_um) {
  constexpr double kDiagonal = 1.4143;
  return static_cast<std::int32_t>(7 * kDiagonal * grid_um / layer_um) + 1;
}

// Returns `bits` with each bit ORed with the `count` bits above it.
std::uint64_t SpreadDown(std::uint64_t bits, std::int32_t count) {
  std::uint64_t spread = bits;
  for (std::int32_t i = 1; i <= std::min(count, 63); ++i) spread |= bits >> i;
  return spread;
}

bool IsFootprintSide(double side_m, const MergeGrid& grid) {
  return side_m >= 0 && side_m * 1e6 / grid.resolution_um <= kBlockSideCellsMax;  // The comparison is false for NaN.
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

PackedBlock::PackedBlock(const Grid& layer, const LayerBlock& block, std::int32_t reach_cells) : block_(block) {
  words_.reserve(static_cast<std::size_t>(strip_count()) * static_cast<std::size_t>(strip_words()) +
                 2 * kStripPaddingWords);
  words_.resize(kStripPaddingWords);
  for (std::int32_t strip = 0; strip < strip_count(); ++strip) {
    const std::int32_t first = strip * kStripColumns;
    const std::int32_t count = std::min(kStripColumns, block.width - first);
    for (std::int32_t row = 0; row < block.height; ++row) {
      const std::size_t at = static_cast<std::size_t>(block.row + row) * layer.width + block.column + first;
      words_.push_back(PackCellsOfWord(layer.cells.data() + at, count));
    }
  }
  words_.resize(words_.size() + kStripPaddingWords);
  MakeCoarseRows(reach_cells);
}

void PackedBlock::MakeCoarseRows(std::int32_t reach_cells) {
  coarse_shift_ = std::max(block_.width, block_.height) <= 256 ? 2 : 3;
  const std::int32_t side = 1 << coarse_shift_;
  const std::int32_t reach_bits = (reach_cells + side - 1) >> coarse_shift_;
  std::vector<std::uint64_t> known(static_cast<std::size_t>((block_.height + side - 1) >> coarse_shift_));
  for (std::int32_t row = 0; row < block_.height; ++row) {
    std::uint64_t& bits = known[static_cast<std::size_t>(row >> coarse_shift_)];
    for (std::int32_t column = 0; column < block_.width; column += side) {
      const std::size_t strip = static_cast<std::size_t>(column / kStripColumns);
      const std::uint32_t word =
          words()[strip * static_cast<std::size_t>(strip_words()) + static_cast<std::size_t>(row)];
      const std::uint32_t cells = word >> (2 * (column % kStripColumns)) & ((1u << (2 * side)) - 1);
      bits |= static_cast<std::uint64_t>(cells != 0) << (column >> coarse_shift_);
    }
  }
  coarse_rows_.resize(known.size());
  for (std::size_t row = 0; row < known.size(); ++row) {
    const std::size_t end = std::min(known.size(), row + static_cast<std::size_t>(reach_bits) + 1);
    for (std::size_t i = row; i < end; ++i) coarse_rows_[row] |= known[i];
    coarse_rows_[row] = SpreadDown(coarse_rows_[row], reach_bits);
  }
}

std::size_t LocalMap::bytes() const {
  std::size_t bytes = sizeof(LocalMap) + layers.capacity() * sizeof(LocalLayer) +
                      blocks.capacity() * sizeof(PackedBlock) + bounds.capacity() * sizeof(LayerBlock);
  for (const PackedBlock& block : blocks) bytes += block.bytes();
  return bytes;
}

Result<std::shared_ptr<const LocalMap>> MakeLocalMap(const RecordKey& key, std::int64_t timestamp_ns,
                                                     const TraversabilityMap& map, const MergeGrid& grid) {
  auto local = std::make_shared<LocalMap>();
  local->key = key;
  local->timestamp_ns = timestamp_ns;
  local->node = map.node;
  local->node_from_map = map.node_from_map;
  for (std::size_t level = 0; level < map.layers.size(); ++level) {
    const MapLayer& layer = map.layers[level];
    if (layer.resolution_um == 0 || std::uint64_t{layer.resolution_um} * kStepCellsMax < grid.resolution_um) {
      return Fail(ErrorCode::kInvalid,
                  "cells of " + std::to_string(layer.resolution_um) +
                      " um are too fine for a merged map with cells of " + std::to_string(grid.resolution_um) + " um",
                  "layers[" + std::to_string(level) + "].resolution_um");
    }
    local->layers.push_back(
        {layer.resolution_um, layer.grid.width, layer.grid.height, layer.center_x_m, layer.center_y_m});
    AddBlocks(layer.grid, static_cast<std::uint8_t>(level), ReachCells(layer.resolution_um, grid.resolution_um),
              *local);
  }
  return local;
}

}  // namespace moondb
