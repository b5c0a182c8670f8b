// CodeLayer: one layer's cells through a range coder, foretold from all that both ends know by then.
//
// Rows go outwards from the middle, the lower half first; within a row cells go outwards from the middle, the right
// half first. So the cells between a cell and the sensor are always known before it, and the four quadrants look alike:
// all neighbours are named as if the cell lay in the quadrant of growing columns and rows (west and north: inwards).
//
// Encoder and decoder run the same code: `Coder` is RangeEncoder, RangeDecoder or anything with their Code().
#pragma once

#include <cstdint>
#include <vector>

#include "actors/sharing/coding/bit_model.h"
#include "actors/sharing/coding/cell_memory.h"
#include "actors/sharing/coding/cell_plane.h"
#include "actors/sharing/coding/ray_table.h"

namespace moondb {

// Which cell of the next coarser layer holds the middle of each column (or row), and in which half of it.
struct CoarserIndex {
  std::vector<std::int32_t> index;  // -1 where it lies outside.
  std::vector<std::uint8_t> half;
};

// What else is known of a layer.
struct LayerContext {
  const CellPlane* coarser = nullptr;  // Null: none, or it has another centre.
  const CoarserIndex* columns = nullptr;
  const CoarserIndex* rows = nullptr;
  const CellPlane* previous = nullptr;  // The placed previous map's memory on this layer's cells; null: none.
  const CellPlane* coarser_previous = nullptr;
  std::uint32_t depth = 0;  // Layers that are finer, at most 3.
  // No cell is a hazard unless the coarser cell is one: then nothing is said of the others.
  bool are_hazards_nested = false;
};

// Fills `cells`, which must be unknown everywhere; an encoder reads them from `source`, which is of the same size.
template <typename Coder>
void CodeLayer(const LayerContext& context, const RayTable& rays, const CellPlane& source, Coder& coder,
               BitModel& model, CellPlane& cells);

}  // namespace moondb
