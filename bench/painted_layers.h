// Layers for mergers that use the painter's algorithm. The layers are unpacked, and sorted so that the best layer is
// painted last.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "actors/merge/placement.h"

namespace moondb {

// Returns the cells of a block, row by row.
std::vector<Cell> UnpackCells(const PackedBlock& packed);

struct PaintedLayer {
  std::uint32_t resolution_um = 0;  // 0 for a footprint.
  std::int64_t timestamp_ns = 0;
  PlacedRectangle placed;
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<Cell> cells;  // Empty for a footprint.
};

// Returns the layers from coarse to fine, layers of equal resolution from old to new, and the footprints at the end.
// Requires: all poses can be placed; otherwise Check fails.
std::vector<PaintedLayer> LayersToPaint(std::span<const PlacedMap> maps, std::span<const Footprint> footprints,
                                        const MergeGrid& grid);

}  // namespace moondb
