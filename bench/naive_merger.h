// NaiveMerger: a simple merger for comparison. For each cell in the bounding box of each map's layer, it applies the
// inverse transform, reads the layer's cell, and compares resolution and time with the best observation so far.
//
// With metres and doubles, the merger is the baseline of merge_bench. With the integers of actors/merge/quantize.h, it
// is an oracle for tests. It shares only this placement with Merger. It uses one thread and one byte per cell.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "actors/merge/placement.h"

namespace moondb {

class NaiveMerger {
 public:
  // The best observation so far of a cell of the merged map.
  struct CellState {
    std::int64_t timestamp_ns = 0;
    std::uint32_t resolution_um = UINT32_MAX;  // UINT32_MAX if unknown.
    std::uint32_t map = UINT32_MAX;            // Index in maps(); UINT32_MAX for a footprint (level 255) or if unknown.
    std::uint8_t level = 0;
    Cell value = Cell::kUnknown;
  };

  // Unpacks the maps. Requires: no two maps have the same key.
  NaiveMerger(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid);

  enum class Arithmetic { kDouble, kInteger };

  // Places the maps and fills cells(). With doubles, cells on borders may differ from the result with integers.
  void Merge(Arithmetic arithmetic = Arithmetic::kInteger);

  const CellBox& extent() const { return extent_; }
  const std::vector<CellState>& cells() const { return cells_; }  // Cells of extent(), row by row.
  const std::vector<PlacedMap>& maps() const { return maps_; }    // Sorted by record key.

 private:
  template <typename Visit>
  void ForEachCell(const PlacedRectangle& p, Visit visit);
  void DrawBlock(const PlacedBlock& placed, const std::vector<Cell>& cells, std::uint32_t map);
  void DrawBlockInDoubles(const PlacedBlock& placed, const std::vector<Cell>& cells, std::uint32_t map);
  void DrawFootprint(const PlacedRectangle& placed);

  const MergeGrid grid_;
  std::vector<PlacedMap> maps_;
  std::vector<Footprint> footprints_;
  std::vector<std::vector<std::vector<Cell>>> block_cells_;  // Indexed by map, block and cell.
  CellBox extent_;
  std::vector<CellState> cells_;
};

}  // namespace moondb
