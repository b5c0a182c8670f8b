// LocalMap: a local traversability map as merging holds it: immutable, its layers cut into blocks of 2 bits a cell.
//
// A block is at most kBlockSideCellsMax a side (what Q10.22 reaches) and has at least one known cell; neighbours share
// one column or row, so that the rounding of two transforms leaves no seam. Its cells lie in strips of 16 columns: one
// 32-bit word holds 16 cells of one row, the leftmost in the lowest bits, and the words of a strip stand row after row.
// So any 16 rows of two neighbouring strips, all that 8 x 8 cells of a merged map of the same or a finer resolution can
// ask for, are two loads of 64 bytes.
//
// Plain values, any thread.
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

struct MergeGrid {
  std::uint32_t resolution_um = 50'000;  // Of the merged map; 1 mm to 100 m.
  double footprint_length_m = 0.75;      // Along the body's x; at most 512 cells; 0 frees nothing.
  double footprint_width_m = 0.5;
  std::int64_t side_cells_max = 16384;  // Of what is read at once.
};

// kInvalid for what lies outside the ranges above, `field` names it.
Result<void> CheckGrid(const MergeGrid& grid);

// Part of a layer.
struct LayerBlock {
  std::uint8_t level = 0;
  std::int32_t column = 0;
  std::int32_t row = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  bool operator==(const LayerBlock&) const = default;
};

// 16 rows beyond both ends may be loaded, never used.
inline constexpr std::int32_t kStripColumns = 16;
inline constexpr std::int32_t kStripPaddingWords = 16;

// Beside its cells a block has a coarse picture of where anything is known, so that a merge need not look where nothing
// is: a bit for each 4 x 4 cells (8 x 8 in large blocks), set if one of the cells that a square of 8 x 8 cells of the
// merged map can reach from there on, to larger rows and columns, is known. Rows of 64 bits.
class PackedBlock {
 public:
  // `reach_cells`: from the least to the greatest column (or row) that 8 x 8 cells of the merged map ask for at once.
  PackedBlock(const Grid& layer, const LayerBlock& block, std::int32_t reach_cells);

  const LayerBlock& block() const { return block_; }
  std::int32_t strip_count() const { return (block_.width + kStripColumns - 1) / kStripColumns; }
  std::int32_t strip_words() const { return block_.height; }  // From one strip to the next.
  const std::uint32_t* words() const { return words_.data() + kStripPaddingWords; }
  const std::uint64_t* coarse_rows() const { return coarse_rows_.data(); }
  int coarse_shift() const { return coarse_shift_; }  // The logarithm of a bit's side.
  std::size_t bytes() const {
    return words_.capacity() * sizeof(std::uint32_t) + coarse_rows_.capacity() * sizeof(std::uint64_t);
  }

  // Within the block.
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
  std::vector<LocalLayer> layers;   // Finest first.
  std::vector<PackedBlock> blocks;  // Those with at least one known cell, by layer.
  std::vector<LayerBlock> bounds;   // All of them.

  AgentId agent() const { return key.stream.origin; }
  std::size_t bytes() const;  // In memory.
};

// kInvalid if a layer's cells are too fine for the grid (more than kStepCellsMax in one of its cells), `field` names
// it. Sizes and numbers of layers are the door's (model/traversability_map.h).
Result<std::shared_ptr<const LocalMap>> MakeLocalMap(const RecordKey& key, std::int64_t timestamp_ns,
                                                     const TraversabilityMap& map, const MergeGrid& grid);

}  // namespace moondb
