// CodeLayer: codes the cells of one layer with a range coder, and predicts each cell from data that encoder and decoder
// already have.
//
// Rows are coded from the middle outwards: first from the middle to the last row, then from the middle to the first
// row. The cells of each row are coded in the same order, from the middle column outwards. The cells between a cell and
// the sensor are therefore always coded before this cell, and the four quadrants are mirror images. Neighbours are
// named as in the quadrant of rising columns and rows: west and north point to the middle.
//
// Encoder and decoder run the same code. `Coder` is RangeEncoder, RangeDecoder or a type with the same Code().
#pragma once

#include <cstdint>
#include <vector>

#include "actors/sharing/coding/bit_model.h"
#include "actors/sharing/coding/cell_memory.h"
#include "actors/sharing/coding/cell_plane.h"
#include "actors/sharing/coding/ray_table.h"

namespace moondb {

// For each column of a layer: the column of the next coarser layer that contains the column's middle, and the half of
// the coarser column in which this middle lies. Rows use a CoarserIndex of their own.
struct CoarserIndex {
  std::vector<std::int32_t> index;  // -1 if the middle lies outside of the coarser layer.
  std::vector<std::uint8_t> half;
};

// Data, besides the layer's own cells, from which the cells of a layer are predicted.
struct LayerContext {
  const CellPlane* coarser = nullptr;  // The next coarser layer; null if there is none.
  const CoarserIndex* columns = nullptr;
  const CoarserIndex* rows = nullptr;
  // The previous map's values of CellMemory, resampled to the cells of this layer; null if no previous map is used.
  const CellPlane* previous = nullptr;
  const CellPlane* coarser_previous = nullptr;
  std::uint32_t depth = 0;  // Number of finer layers, at most 3.
  // True if each hazard cell lies in a hazard cell of the coarser layer. The hazard bit is then coded only for cells
  // that lie in hazard cells of the coarser layer.
  bool are_hazards_nested = false;
};

// Codes a layer and fills `cells`. An encoder reads the cells from `source`. Requires: all of `cells` are unknown, and
// `source` has the size of `cells`.
template <typename Coder>
void CodeLayer(const LayerContext& context, const RayTable& rays, const CellPlane& source, Coder& coder,
               BitModel& model, CellPlane& cells);

}  // namespace moondb
