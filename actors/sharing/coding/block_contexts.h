// BlockContexts: computes the contexts (bit_model.h) of a block of neighbouring cells in a row, all at once.
//
// Most inputs of a prediction are known before the row begins: the rows nearer to the layer's middle, which are coded
// first; the coarser layer; and the previous map, placed over this map. The contexts of kBlock cells are therefore
// computed together, in loops that compilers vectorise. Only the inputs from the row's own cells are added cell by
// cell.
//
// Neighbours are named as in layer_coder.h; west2 is the second cell to the west, north_east2 the cell east of
// north_east. Nearly all models use the coarser cell at the same place, and the quarter of this coarser cell in which
// the cell lies. In addition each model uses the following cells:
//   Model 0: west, north, north_west, north_east, west2, north2.
//   Model 1: west, north, north_east; coarser cells east, south, south_east.
//   Model 2: 12 cells around, reduced to one bit each.
//   Model 3: west, north, north_west, north_east; bearing.
//   Model 4: three cells along the ray; distance, depth.
//   Model 5: coarser cells (the two nearest, east, south); one cell along the ray; west.
//   Model 6: west, north, one cell along the ray; depth, bearing.
//   Model 7: five coarser cells.
//   Model 8: west, north, north_east, north_east2, north_east3, north2_east.
//   Model 9: west, north; 9 coarser cells, reduced to one bit each.
// Models 10 to 13 are used only with a previous map.
//   Model 10: previous map at this place and at the four cells beside it.
//   Model 11: west, north; previous map here, east, south_east.
//   Model 12: west, north; 9 cells of the previous map, reduced to one bit each.
//   Model 13: west, north, north_east; previous map here and at the coarser cell.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "actors/sharing/coding/bit_model.h"
#include "actors/sharing/coding/layer_coder.h"
#include "actors/sharing/coding/ray_table.h"

namespace moondb {

// A quadrant of a layer: the directions in x and y that lead away from the middle (1 or -1), and its number.
struct Quadrant {
  std::int32_t x = 1;
  std::int32_t y = 1;
  int number = 0;
};

// The cells nearest to a cell that are already coded: three to the west in its row, and three along its ray to the
// sensor.
struct NearCells {
  int west, west2, west3;
  int ray1, ray2, ray3;
};

class BlockContexts {
 public:
  static constexpr std::size_t kBlock = 32;

  struct Block {
    Quadrant quadrant;
    std::int32_t column, row;  // Position of the first cell.
    std::size_t size;          // Number of cells, at most kBlock.
    // The cells north of the block, from the first cell outwards, and the cells of the next row to the north. Each of
    // these two rows can be read from 2 cells before the first cell to kBlock + 3 cells behind it.
    const std::uint8_t* north;
    const std::uint8_t* north2;
    const RayTable::Ray* rays;
  };

  explicit BlockContexts(const LayerContext& layer);

  void StartRow(std::int32_t row, std::int32_t outwards);
  void Start(const Block& block);

  // True if the neighbouring rows, the coarser layer and the previous map are all unknown around the block's cell `i`.
  // Does not check the cell's own row.
  bool IsQuiet(std::size_t i) const { return around_.is_quiet[i] != 0; }
  // False if hazards are nested (LayerContext) and the coarser cell at the place of the block's cell `i` is no hazard.
  bool MayBeHazard(std::size_t i) const { return !layer_.are_hazards_nested || coarser_.here[i] >= 2; }
  // SetShared sets the contexts that both decisions have in common. Call SetOwn afterwards to set the other contexts of
  // one decision.
  template <bool kHasPrevious>
  void SetShared(std::size_t i, const NearCells& near, BitContexts& contexts);
  template <bool kHasPrevious>
  void SetOwn(Decision decision, std::size_t i, const NearCells& near, BitContexts& contexts) const;

 private:
  using Numbers = std::array<std::uint16_t, kBlock>;

  // For each cell of the block: the already coded cells around it, and its position relative to the sensor.
  struct Around {
    Numbers north, north_west, north_west2, north_east, north_east2, north_east3, north2, north2_west, north2_east;
    Numbers bearing, distance;
    Numbers is_quiet;
  };
  struct Coarser {
    Numbers here, east, south, south_east, west, north, north_east, south_west, north_west;
    Numbers half_x, half_y;  // 1 if the cell lies in the outer half of its coarser cell.
    Numbers memory;          // The previous map's cell at the coarser cell's place.
  };
  struct Previous {
    Numbers here, east, south, south_east, west, north, north_east, south_west, north_west;
    Numbers last, state;
  };
  // The contexts of all cells of the block, without the contributions of NearCells.
  struct Ready {
    std::array<Numbers, kModelsWithPrevious> models;
    std::array<std::array<Numbers, kModelsWithPrevious>, kDecisionCount> own;
    std::array<Numbers, kChoiceCount> weight_sets;
    Numbers refinement;
  };

  static Numbers Widen(const std::uint8_t* cells);
  void LookUpCoarser(const Block& block);
  void LookUpPrevious(const Block& block);
  void Make();
  void MakeOwn(Decision decision);
  void MakeWithPrevious();

  // Returns the number with these digits in the given base, most significant digit first.
  template <typename... Digits>
  static std::uint16_t Join(int base, int first, Digits... rest) {
    ((first = static_cast<std::uint16_t>(first * base + rest)), ...);
    return static_cast<std::uint16_t>(first);
  }
  // Returns a decision's answer for a cell: 1 if the cell is known (kIsKnown), or if it is a hazard (kIsHazard).
  static std::uint16_t BitOf(Decision decision, int cell) {
    return static_cast<std::uint16_t>(cell) > static_cast<std::uint16_t>(decision) ? 1 : 0;
  }

  const LayerContext& layer_;
  // A row of the coarser layer. Each number packs a cell and its north and south neighbours, two bits each.
  std::vector<std::uint8_t> coarser_row_;
  Around around_{};
  Coarser coarser_{};
  Previous previous_{};
  Ready ready_{};
  bool is_ready_ = false;
};

template <bool kHasPrevious>
[[gnu::always_inline]] inline void BlockContexts::SetShared(std::size_t i, const NearCells& near,
                                                            BitContexts& contexts) {
  if (!is_ready_) Make();
  const int west = near.west;
  const auto& ready = ready_.models;
  auto& models = contexts.models;
  contexts.has_previous = kHasPrevious;
  models[0] = ready[0][i] + Join(3, west, 0, 0, 0, near.west2, 0) * 4u;
  models[1] = ready[1][i] + Join(3, west, 0, 0, 0, 0, 0) * 16u;
  models[3] = ready[3][i] + Join(3, west, 0, 0, 0) * 128u;
  models[4] = ready[4][i] + Join(3, near.ray1, near.ray2, near.ray3) * 128u;
  models[5] = ready[5][i] + Join(3, near.ray1, west) * 16u;
  models[6] = ready[6][i] + Join(3, west, 0, near.ray1) * 512u;
  models[7] = ready[7][i];
  models[8] = ready[8][i] + Join(3, west, 0, 0, 0, 0, 0) * 4u;
  contexts.weight_sets[1] = ready_.weight_sets[1][i];
  if constexpr (kHasPrevious) {
    models[10] = ready[10][i];
    models[11] = ready[11][i] + Join(3, west, 0, 0, 0) * 64u;
    models[13] = ready[13][i] + Join(3, west, 0, 0) * 256u;
    contexts.weight_sets[0] = ready_.weight_sets[0][i] + Join(3, west, 0) * 16u;
    contexts.refinement = ready_.refinement[i] + Join(3, west, 0) * 16u;
  } else {
    contexts.weight_sets[0] = ready_.weight_sets[0][i] + Join(3, west, 0, 0) * 4u;
    contexts.refinement = ready_.refinement[i] + Join(3, near.ray1, 0, west, 0) * 4u;
  }
}

template <bool kHasPrevious>
[[gnu::always_inline]] inline void BlockContexts::SetOwn(Decision decision, std::size_t i, const NearCells& near,
                                                         BitContexts& contexts) const {
  const auto& ready = ready_.own[static_cast<std::size_t>(decision)];
  const std::uint32_t west = BitOf(decision, near.west);
  contexts.decision = decision;
  contexts.models[2] = ready[2][i] + (west << 11) + (BitOf(decision, near.west2) << 7) + BitOf(decision, near.west3);
  contexts.models[9] = ready[9][i] + (west << 12);
  if constexpr (kHasPrevious) contexts.models[12] = ready[12][i] + (west << 12);
}

}  // namespace moondb
