#include "actors/sharing/coding/layer_coder.h"

#include <algorithm>

#include "actors/sharing/coding/block_contexts.h"
#include "actors/sharing/coding/range_coder.h"

namespace moondb {

namespace {

constexpr std::uint8_t kUnknown = 0;
constexpr std::uint8_t kFree = 1;
constexpr std::uint8_t kHazard = 2;

template <typename Coder, bool kHasPrevious>
class LayerCoder {
 public:
  LayerCoder(const LayerContext& context, const RayTable& rays, const CellPlane& source, Coder& coder, BitModel& model,
             CellPlane& cells)
      : rays_(rays),
        source_(source),
        coder_(coder),
        model_(model),
        cells_(cells),
        blocks_(context),
        stride_(cells.width() + 2 * CellPlane::kMargin + static_cast<std::int32_t>(BlockContexts::kBlock)),
        window_(static_cast<std::size_t>(kWindowRows * stride_)) {
    for (std::int32_t i = 0; i < kWindowRows * kWindowRows; ++i) {
      ray_offsets_[static_cast<std::size_t>(i)] = i / kWindowRows * stride_ - i % kWindowRows;
    }
  }

  void Run() {
    const std::int32_t middle = cells_.height() / 2;
    for (std::int32_t row = middle; row < cells_.height(); ++row) CodeRow(row, 1);
    for (std::int32_t row = middle - 1; row >= 0; --row) CodeRow(row, -1);
  }

 private:
  static constexpr std::int32_t kWindowRows = RayTable::kSteps + 1;

  void CodeRow(std::int32_t row, std::int32_t outwards) {
    const std::int32_t rows_out = outwards > 0 ? row - cells_.height() / 2 : (cells_.height() - 1) / 2 - row;
    const RayTable::Ray* rays = rays_.RowAt(rows_out);
    const std::int32_t middle = cells_.width() / 2;
    blocks_.StartRow(row, outwards);
    CodeHalfRow({1, outwards, outwards > 0 ? 0 : 1}, middle, row, cells_.width() - middle, rays);
    CodeHalfRow({-1, outwards, outwards > 0 ? 2 : 3}, middle - 1, row, middle, rays + cells_.width() % 2);
  }

  // Codes `count` cells of a row, from column `first` outwards.
  void CodeHalfRow(const Quadrant& quadrant, std::int32_t first, std::int32_t row, std::int32_t count,
                   const RayTable::Ray* rays) {
    for (std::int32_t rows_in = 0; rows_in < kWindowRows; ++rows_in) {
      const std::uint8_t* from = cells_.At(first - CellPlane::kMargin * quadrant.x, row - rows_in * quadrant.y);
      std::uint8_t* to = window_.data() + rows_in * stride_;
      const std::int32_t size = count + 2 * CellPlane::kMargin;
      quadrant.x > 0 ? std::copy_n(from, size, to) : std::reverse_copy(from - size + 1, from + 1, to);
    }
    constexpr std::int32_t kBlock = static_cast<std::int32_t>(BlockContexts::kBlock);
    for (std::int32_t begin = 0; begin < count; begin += kBlock) {
      std::uint8_t* cell = window_.data() + CellPlane::kMargin + begin;
      const std::int32_t column = first + begin * quadrant.x;
      const std::size_t size = static_cast<std::size_t>(std::min(kBlock, count - begin));
      blocks_.Start({quadrant, column, row, size, cell + stride_, cell + 2 * stride_, rays + begin});
      const std::uint8_t* source = source_.At(column, row);
      std::uint8_t* coded = cells_.At(column, row);
      for (std::size_t i = 0; i < size; ++i, source += quadrant.x, coded += quadrant.x) {
        CodeCell(Coder::kIsEncoder ? *source : 0, i, rays[static_cast<std::size_t>(begin) + i], cell + i);
        *coded = cell[i];
      }
    }
  }

  // Codes the block's cell `i`. `cell` points to this cell in window_.
  void CodeCell(std::uint32_t value, std::size_t i, const RayTable::Ray& ray, std::uint8_t* cell) {
    if (blocks_.IsQuiet(i) && (cell[-1] | cell[-2]) == kUnknown) {
      if (CodeRare(Decision::kIsKnown, value != kUnknown)) {
        *cell = CodeRare(Decision::kIsHazard, value == kHazard) ? kHazard : kFree;
      }
      return;
    }
    const NearCells near = {cell[-1],
                            cell[-2],
                            cell[-3],
                            cell[ray_offsets_[ray.cells_in[0]]],
                            cell[ray_offsets_[ray.cells_in[1]]],
                            cell[ray_offsets_[ray.cells_in[2]]]};
    BitContexts contexts;
    blocks_.SetShared<kHasPrevious>(i, near, contexts);
    blocks_.SetOwn<kHasPrevious>(Decision::kIsKnown, i, near, contexts);
    const BitModel::Prediction known = model_.Predict(contexts);
    if (coder_.Code(value != kUnknown ? 1 : 0, known.probability) == 0) return model_.Update(known, 0);
    *cell = kFree;
    if (!blocks_.MayBeHazard(i)) return model_.Update(known, 1);
    // Update the model for the first decision only after the second is coded, so the processor can work on both in
    // parallel.
    blocks_.SetOwn<kHasPrevious>(Decision::kIsHazard, i, near, contexts);
    const BitModel::Prediction hazard = model_.Predict(contexts);
    const int bit = coder_.Code(value == kHazard ? 1 : 0, hazard.probability);
    model_.Update(known, 1);
    if (bit == 0) return model_.Update(hazard, 0);
    *cell = kHazard;
    model_.Update(hazard, 1);
  }

  bool CodeRare(Decision decision, bool value) {
    const int bit = coder_.Code(value ? 1 : 0, model_.PredictRare(decision));
    model_.UpdateRare(decision, bit);
    return bit != 0;
  }

  const RayTable& rays_;
  const CellPlane& source_;
  Coder& coder_;
  BitModel& model_;
  CellPlane& cells_;
  BlockContexts blocks_;
  // The window holds half of a row, and the same half of the kWindowRows - 1 rows next to it towards the middle.
  // Columns are ordered from the middle outwards, with the plane's margin at both ends.
  std::int32_t stride_;
  std::vector<std::uint8_t> window_;
  std::array<std::ptrdiff_t, kWindowRows * kWindowRows> ray_offsets_;  // Offsets in window_, by Ray::cells_in.
};

}  // namespace

template <typename Coder>
void CodeLayer(const LayerContext& context, const RayTable& rays, const CellPlane& source, Coder& coder,
               BitModel& model, CellPlane& cells) {
  if (context.previous) {
    LayerCoder<Coder, true>(context, rays, source, coder, model, cells).Run();
  } else {
    LayerCoder<Coder, false>(context, rays, source, coder, model, cells).Run();
  }
}

template void CodeLayer(const LayerContext&, const RayTable&, const CellPlane&, RangeEncoder&, BitModel&, CellPlane&);
template void CodeLayer(const LayerContext&, const RayTable&, const CellPlane&, RangeDecoder&, BitModel&, CellPlane&);

}  // namespace moondb
