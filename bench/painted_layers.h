// What mergers that paint layer over layer, the best one last, have in common: the layers, unpacked and in that order.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "actors/merge/placement.h"

namespace moondb {

// Row after row.
std::vector<Cell> UnpackCells(const PackedBlock& packed);

struct PaintedLayer {
  std::uint32_t resolution_um = 0;  // 0: a footprint.
  std::int64_t timestamp_ns = 0;
  PlacedRectangle placed;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<Cell> cells;  // None of a footprint.
};

// Coarse before fine, old before new, footprints at the end. Poses are to be such that all can be placed (Check).
std::vector<PaintedLayer> LayersToPaint(std::span<const PlacedMap> maps, std::span<const Footprint> footprints,
                                        const MergeGrid& grid);

}  // namespace moondb
