// BlockContexts: the contexts (bit_model.h) of some neighbouring cells of a row, made for all of them at once.
//
// Nearly all that foretells a cell is known before its row is begun: the rows nearer to the middle, the coarser layer
// and the placed previous map. So the contexts of kBlock cells are made together, in loops over short numbers of which
// compilers do eight at a time; only what the row's own cells tell is added cell by cell.
//
// Neighbours are named as in layer_coder.h; west2 is the second one to the west, north_east2 the one east of
// north_east. The models look at these, and nearly all at the coarser cell here and in which quarter of it the cell
// lies:
//   0  west north north_west north_east west2 north2           10  previous map: here and the four beside it
//   1  west north north_east, coarser east south south_east    11  west north, previous map: here east south_east
//   2  12 cells, one bit of each                               12  west north, previous map: 9 cells, one bit of each
//   3  west north north_west north_east, bearing               13  west north north_east, previous maps: here, coarser
//   4  three cells along the ray, distance, depth
//   5  coarser: the two nearest, east and south; ray, west
//   6  west north, ray, depth, bearing
//   7  coarser: five cells
//   8  west north north_east north_east2 north_east3 north2_east
//   9  west north, coarser: 9 cells, one bit of each
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "actors/sharing/coding/bit_model.h"
#include "actors/sharing/coding/layer_coder.h"
#include "actors/sharing/coding/ray_table.h"

namespace moondb {

// Which way is outwards.
struct Quadrant {
  std::int32_t x = 1;
  std::int32_t y = 1;
  int number = 0;
};

// What the row's own cells and the ray tell of a cell.
struct NearCells {
  int west, west2, west3;
  int ray1, ray2, ray3;
};

class BlockContexts {
 public:
  static constexpr std::size_t kBlock = 32;

  struct Block {
    Quadrant quadrant;
    std::int32_t column, row;    // Of the first cell.
    std::size_t size;            // At most kBlock.
    const std::uint8_t* north;   // Inwards of the first cell, by columns outwards; the row inwards of that.
    const std::uint8_t* north2;  // Both can be read from 2 cells before to kBlock + 3 behind.
    const RayTable::Ray* rays;
  };

  explicit BlockContexts(const LayerContext& layer);

  void StartRow(std::int32_t row, std::int32_t outwards);
  void Start(const Block& block);

  // Of the block's cell `i`: whether all around it is unknown but for its own row; whether a hazard is possible.
  bool IsQuiet(std::size_t i) const { return around_.is_quiet[i] != 0; }
  bool MayBeHazard(std::size_t i) const { return !layer_.are_hazards_nested || coarser_.here[i] >= 2; }
  // Sets what is the same for both decisions, then what is not.
  template <bool kHasPrevious>
  void SetShared(std::size_t i, const NearCells& near, BitContexts& contexts);
  template <bool kHasPrevious>
  void SetOwn(Decision decision, std::size_t i, const NearCells& near, BitContexts& contexts) const;

 private:
  using Numbers = std::array<std::uint16_t, kBlock>;

  // Cells around each one of the block, and where it lies.
  struct Around {
    Numbers north, north_west, north_west2, north_east, north_east2, north_east3, north2, north2_west, north2_east;
    Numbers bearing, distance;
    Numbers is_quiet;
  };
  struct Coarser {
    Numbers here, east, south, south_east, west, north, north_east, south_west, north_west;
    Numbers half_x, half_y;  // 1: the outer half of it.
    Numbers memory;          // The last map's cell there.
  };
  struct Previous {
    Numbers here, east, south, south_east, west, north, north_east, south_west, north_west;
    Numbers last, state;
  };
  // Contexts less what NearCells add.
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

  // A number to the base 3 (or another) from its digits, the first one being the highest.
  template <typename... Digits>
  static std::uint16_t Join(int base, int first, Digits... rest) {
    ((first = static_cast<std::uint16_t>(first * base + rest)), ...);
    return static_cast<std::uint16_t>(first);
  }
  // Of a cell only one bit: is it known, or is it a hazard?
  static std::uint16_t BitOf(Decision decision, int cell) {
    return static_cast<std::uint16_t>(cell) > static_cast<std::uint16_t>(decision) ? 1 : 0;
  }

  const LayerContext& layer_;
  std::vector<std::uint8_t> coarser_row_;  // In one number: a cell, the one inwards of it and the one outwards.
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
