// LocalMap: a local traversability map in the form used for merging. It is immutable, and its layers are cut into
// blocks with 2 bits per cell.
//
// A block has at most kBlockSideCellsMax cells per side and at least one known cell. Neighbouring blocks share one
// column or row, so rounding of their two transforms leaves no seam. Cells are stored in strips of 16 columns. One
// 32-bit word holds 16 cells of one row, the leftmost in the lowest bits. The words of a strip are in row order.
//
// Value types, usable on any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "actors/merge/quantize.h"
#include "model/error.h"
#include "model/record_key.h"
#include "model/traversability_map.h"

namespace moondb {

// Maximum number of pages of a merged map: 67 million cells. A page of which all cells are known takes 0.155 MB
// (measured), so all of them take 160 MB, a fifth of the 800 MB that the shipped unit allows an agent. A team of three
// with 4,323 maps touches 225 pages.
inline constexpr std::size_t kPagesMax = 1024;

struct MergeGrid {
  std::uint32_t resolution_um = 50'000;  // Cell size of the merged map; 1 mm to 100 m.
  double footprint_length_m = 0.75;      // Length along the body's x axis, at most 512 cells. 0 disables footprints.
  double footprint_width_m = 0.5;
  std::int64_t side_cells_max = 16384;  // Maximum side, in cells, of a map and of a box that one call reads.
  std::size_t pages_max = kPagesMax;    // Maximum number of pages of a merged map (actors/merge/tile.h).
};

// Returns kInvalid, with the name of the field, if a value is outside the ranges given in MergeGrid.
Result<void> CheckGrid(const MergeGrid& grid);

// A rectangular part of a layer.
struct LayerBlock {
  std::uint8_t level = 0;
  std::int32_t column = 0;
  std::int32_t row = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  bool operator==(const LayerBlock&) const = default;
};

// Number of columns of a strip, and number of padding words before the first strip and after the last strip. A kernel
// may load padding words, but never uses their values.
inline constexpr std::int32_t kStripColumns = 16;
inline constexpr std::int32_t kStripPaddingWords = 16;

// Cells of a block, and a coarse bitmap with which a merge skips unknown areas. One bit of the bitmap covers 4 x 4
// cells, or 8 x 8 cells if a side of the block exceeds 256 cells. Each bitmap row has 64 bits. A merge looks up one bit
// per square (8 x 8 cells of the merged map): the bit at the lowest row and column of the block that lie under the
// square. A bit is clear only if no square that looks up this bit reads a known cell.
class PackedBlock {
 public:
  // `reach_cells`: maximum distance, in columns or rows, between two cells that one 8 x 8 square of the merged map
  // reads.
  PackedBlock(const Grid& layer, const LayerBlock& block, std::int32_t reach_cells);

  const LayerBlock& block() const { return block_; }
  std::int32_t strip_count() const { return (block_.width + kStripColumns - 1) / kStripColumns; }
  std::int32_t strip_words() const { return block_.height; }  // Number of words from one strip to the next.
  const std::uint32_t* words() const { return words_.data() + kStripPaddingWords; }
  const std::uint64_t* coarse_rows() const { return coarse_rows_.data(); }
  // One bit of the bitmap covers 2^coarse_shift x 2^coarse_shift cells.
  int coarse_shift() const { return coarse_shift_; }
  std::size_t bytes() const {
    return words_.capacity() * sizeof(std::uint32_t) + coarse_rows_.capacity() * sizeof(std::uint64_t);
  }

  // Requires: the cell is within the block.
  Cell At(std::int32_t column, std::int32_t row) const {
    const std::size_t strip = static_cast<std::size_t>(column / kStripColumns);
    const std::uint32_t word = words()[strip * static_cast<std::size_t>(strip_words()) + static_cast<std::size_t>(row)];
    return static_cast<Cell>(word >> (2 * (column % kStripColumns)) & 3);
  }

 private:
  void MakeCoarseRows(std::int32_t reach_cells);

  LayerBlock block_;
  std::vector<std::uint32_t> words_;
  std::vector<std::uint64_t> coarse_rows_;
  int coarse_shift_ = 2;
};

struct LocalLayer {
  std::uint32_t resolution_um = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  double center_x_m = 0;
  double center_y_m = 0;
};

struct LocalMap {
  RecordKey key;
  std::int64_t timestamp_ns = 0;
  NodeKey node;
  Pose node_from_map;
  std::vector<LocalLayer> layers;   // Sorted from the finest to the coarsest.
  std::vector<PackedBlock> blocks;  // Blocks with at least one known cell, sorted by layer.
  std::vector<LayerBlock> bounds;   // All blocks, including those without a known cell.

  AgentId agent() const { return key.stream.origin; }
  std::size_t bytes() const;  // Memory use in bytes.
};

// Converts a map for merging. Returns kInvalid, with the name of the field, if more than kStepCellsMax cells of a layer
// lie along one grid cell. The record validator has checked the sizes and the number of layers
// (model/traversability_map.h).
Result<std::shared_ptr<const LocalMap>> MakeLocalMap(const RecordKey& key, std::int64_t timestamp_ns,
                                                     const TraversabilityMap& map, const MergeGrid& grid);

}  // namespace moondb
