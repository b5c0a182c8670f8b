// NaiveMerger: what one writes first, well. Each map, each layer, each cell of the merged map in the layer's bounding
// box: the inverse transform, the layer's cell there, and a comparison of resolution and time with what the cell holds.
//
// In metres and doubles it is the yardstick of merge_bench; with the integers of actors/merge/quantize.h, and none of
// Merger's code, an oracle for tests, and a harder yardstick. One thread; the layers lie unpacked, a byte a cell.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "actors/merge/placement.h"

namespace moondb {

class NaiveMerger {
 public:
  // What is known of a cell of the merged map.
  struct CellState {
    std::int64_t timestamp_ns = 0;
    std::uint32_t resolution_um = UINT32_MAX;  // Unknown.
    std::uint32_t map = UINT32_MAX;            // Index; UINT32_MAX with level 255: a footprint.
    std::uint8_t level = 0;
    Cell value = Cell::kUnknown;
  };

  // Unpacks the maps, which are to have different keys.
  NaiveMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid);

  enum class Arithmetic { kDouble, kInteger };

  // Places the maps and fills the grid of their extent. In doubles cells on borders may come out otherwise.
  void Merge(Arithmetic arithmetic = Arithmetic::kInteger);

  const CellBox& extent() const { return extent_; }
  const std::vector<CellState>& cells() const { return cells_; }  // Of the extent, row after row.
  const std::vector<PlacedMap>& maps() const { return maps_; }    // By record key.

 private:
  template <typename Visit>
  void ForEachCell(const PlacedRectangle& p, Visit visit);
  void DrawBlock(const PlacedBlock& placed, const std::vector<Cell>& cells, std::uint32_t map);
  void DrawBlockInDoubles(const PlacedBlock& placed, const std::vector<Cell>& cells, std::uint32_t map);
  void DrawFootprint(const PlacedRectangle& placed);

  const MergeGrid grid_;
  std::vector<PlacedMap> maps_;
  std::vector<Footprint> footprints_;
  std::vector<std::vector<std::vector<Cell>>> block_cells_;  // By map and block.
  CellBox extent_;
  std::vector<CellState> cells_;
};

}  // namespace moondb
