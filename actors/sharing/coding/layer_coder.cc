#include "actors/sharing/coding/layer_coder.h"

#include "actors/sharing/coding/range_coder.h"

namespace moondb {

namespace {

constexpr std::uint32_t kUnknown = 0;
constexpr std::uint32_t kHazard = 2;
constexpr std::uint32_t kNoCoarser = 3;

// A number to the base 3 (or another) from its digits, the first one being the highest.
template <typename... Digits>
std::uint32_t Join(std::uint32_t base, std::uint32_t first, Digits... rest) {
  ((first = first * base + rest), ...);
  return first;
}

// Which way is outwards.
struct Quadrant {
  std::int32_t x = 1;
  std::int32_t y = 1;
  std::uint32_t number = 0;
};

// A cell's neighbours in one plane, by columns and rows outwards.
class Neighbours {
 public:
  Neighbours(const std::uint8_t* cell, Quadrant quadrant, std::int32_t stride)
      : cell_(cell), column_(quadrant.x), row_(quadrant.y * static_cast<std::ptrdiff_t>(stride)) {}
  std::uint32_t operator()(int columns_out, int rows_out) const {
    return cell_[columns_out * column_ + rows_out * row_];
  }

 private:
  const std::uint8_t* cell_;
  std::ptrdiff_t column_;
  std::ptrdiff_t row_;
};

// The coarser layer about a cell.
struct Coarser {
  std::uint32_t here = kNoCoarser;
  std::uint32_t east = 0, south = 0, south_east = 0, west = 0, north = 0, north_east = 0, south_west = 0,
                north_west = 0;
  std::uint32_t half_x = 0, half_y = 0;  // 1: the outer half of it.

  std::uint32_t sub() const { return half_x + 2 * half_y; }
  bool AreAllUnknown() const {
    return here == kUnknown &&
           (east | south | south_east | west | north | north_east | south_west | north_west) == kUnknown;
  }
};

template <typename Coder>
class LayerCoder {
 public:
  LayerCoder(const LayerContext& context, const RayTable& rays, const CellPlane& source, Coder& coder, BitModel& model,
             CellPlane& cells)
      : context_(context), rays_(rays), source_(source), coder_(coder), model_(model), cells_(cells) {
    contexts_.has_previous = context.previous != nullptr;
  }

  void Run() {
    const std::int32_t middle = cells_.height() / 2;
    for (std::int32_t row = middle; row < cells_.height(); ++row) CodeRow(row, 1);
    for (std::int32_t row = middle - 1; row >= 0; --row) CodeRow(row, -1);
  }

 private:
  void CodeRow(std::int32_t row, std::int32_t outwards) {
    const std::int32_t rows_out = outwards > 0 ? row - cells_.height() / 2 : (cells_.height() - 1) / 2 - row;
    const RayTable::Ray* rays = rays_.RowAt(rows_out);
    const std::int32_t middle = cells_.width() / 2;
    quadrant_ = {1, outwards, outwards > 0 ? 0u : 1u};
    for (std::int32_t column = middle; column < cells_.width(); ++column) CodeCell(column, row, rays[column - middle]);
    quadrant_ = {-1, outwards, outwards > 0 ? 2u : 3u};
    const std::int32_t last = (cells_.width() - 1) / 2;
    for (std::int32_t column = middle - 1; column >= 0; --column) CodeCell(column, row, rays[last - column]);
  }

  void CodeCell(std::int32_t column, std::int32_t row, const RayTable::Ray& ray) {
    std::uint8_t* cell = cells_.At(column, row);
    const Neighbours at(cell, quadrant_, cells_.stride());
    const Coarser coarser = LookUp(column, row);
    const std::uint8_t* previous = context_.previous ? context_.previous->At(column, row) : nullptr;
    const std::uint32_t value = Coder::kIsEncoder ? *source_.At(column, row) : 0;
    const bool is_rare = coarser.AreAllUnknown() && (!previous || LastOrUnknown(*previous) == kUnknown) &&
                         (at(-1, 0) | at(0, -1) | at(-1, -1) | at(1, -1) | at(-2, 0) | at(0, -2)) == kUnknown;
    if (is_rare) {
      if (CodeRare(Decision::kIsKnown, value != kUnknown)) {
        *cell = CodeRare(Decision::kIsHazard, value == kHazard) ? 2 : 1;
      }
      return;
    }
    SetSharedContexts(at, coarser, ray);
    if (previous) SetPreviousContexts(column, row, at, coarser);
    if (!CodeMixed(Decision::kIsKnown, value != kUnknown, at, coarser, previous)) return;
    *cell = 1;
    if (context_.are_hazards_nested && coarser.here < kHazard) return;
    if (CodeMixed(Decision::kIsHazard, value == kHazard, at, coarser, previous)) *cell = 2;
  }

  Coarser LookUp(std::int32_t column, std::int32_t row) const {
    Coarser coarser;
    if (!context_.coarser) return coarser;
    const std::int32_t x = context_.columns->index[static_cast<std::size_t>(column)];
    const std::int32_t y = context_.rows->index[static_cast<std::size_t>(row)];
    if (x < 0 || y < 0) return coarser;
    const Neighbours at(context_.coarser->At(x, y), quadrant_, context_.coarser->stride());
    coarser.here = at(0, 0);
    coarser.east = at(1, 0);
    coarser.south = at(0, 1);
    coarser.south_east = at(1, 1);
    coarser.west = at(-1, 0);
    coarser.north = at(0, -1);
    coarser.north_east = at(1, -1);
    coarser.south_west = at(-1, 1);
    coarser.north_west = at(-1, -1);
    const bool is_far_x = context_.columns->half[static_cast<std::size_t>(column)] != 0;
    const bool is_far_y = context_.rows->half[static_cast<std::size_t>(row)] != 0;
    coarser.half_x = is_far_x == (quadrant_.x > 0) ? 1 : 0;
    coarser.half_y = is_far_y == (quadrant_.y > 0) ? 1 : 0;
    return coarser;
  }

  bool CodeRare(Decision decision, bool value) {
    const int bit = coder_.Code(value ? 1 : 0, model_.PredictRare(decision));
    model_.UpdateRare(decision, bit);
    return bit != 0;
  }

  bool CodeMixed(Decision decision, bool value, const Neighbours& at, const Coarser& coarser,
                 const std::uint8_t* previous) {
    contexts_.decision = decision;
    SetTemplates(at, coarser, previous);
    const int bit = coder_.Code(value ? 1 : 0, model_.Predict(contexts_));
    model_.Update(bit);
    return bit != 0;
  }

  // Those that are the same for both decisions.
  void SetSharedContexts(const Neighbours& at, const Coarser& c, const RayTable::Ray& ray) {
    const std::uint32_t west = at(-1, 0), north = at(0, -1), north_west = at(-1, -1), north_east = at(1, -1);
    const std::uint32_t ray1 = at(-ray.columns_in[0], -ray.rows_in[0]);
    const std::uint32_t ray2 = at(-ray.columns_in[1], -ray.rows_in[1]);
    const std::uint32_t ray3 = at(-ray.columns_in[2], -ray.rows_in[2]);
    const std::uint32_t bearing = quadrant_.number * 8 + ray.bearing;
    const std::uint32_t inwards = Join(3, west, north);
    auto& models = contexts_.models;
    models[0] = Join(3, inwards, north_west, north_east, at(-2, 0), at(0, -2)) * 4 + c.here;
    models[1] = ((Join(3, inwards, north_east, c.east, c.south, c.south_east) * 4) + c.sub()) * 4 + c.here;
    models[3] = (Join(3, inwards, north_west, north_east) * 4 + c.here) * 32 + bearing;
    models[4] = ((Join(3, ray1, ray2, ray3) * 4 + c.here) * 8 + ray.distance) * 4 + context_.depth;
    models[5] =
        (Join(3, c.half_x != 0 ? c.east : c.west, c.half_y != 0 ? c.south : c.north, c.east, c.south, ray1, west) * 4 +
         c.sub()) *
            4 +
        c.here;
    models[6] = ((Join(3, inwards, ray1) * 4 + c.here) * 4 + context_.depth) * 32 + bearing;
    models[7] = (Join(3, c.east, c.south, c.south_east, c.west, c.north) * 4 + c.sub()) * 4 + c.here;
    models[8] = Join(3, inwards, north_east, at(2, -1), at(1, -2), at(3, -1)) * 4 + c.here;
    contexts_.weight_sets = {Join(3, inwards, north_east) * 4 + c.here, bearing * 8 + ray.distance};
    contexts_.refinement = Join(3, ray1, c.here % 3, west, north) * 4 + c.sub();
  }

  void SetPreviousContexts(std::int32_t column, std::int32_t row, const Neighbours& at, const Coarser& c) {
    const Neighbours previous(context_.previous->At(column, row), quadrant_, context_.previous->stride());
    const auto last = [&previous](int columns_out, int rows_out) {
      return LastOrUnknown(static_cast<CellMemory>(previous(columns_out, rows_out)));
    };
    const std::uint32_t here = LastCell(static_cast<CellMemory>(previous(0, 0)));
    const std::uint32_t state = kMemoryStateOf[previous(0, 0)];
    const std::uint32_t inwards = Join(3, at(-1, 0), at(0, -1));
    const std::uint32_t east = last(1, 0);
    auto& models = contexts_.models;
    models[10] = (Join(3, east, last(0, 1), last(-1, 0), last(0, -1)) * 4 + c.here) * kMemoryStates + state;
    models[11] = ((Join(3, inwards, east, last(1, 1)) * 4 + c.sub()) * 4 + c.here) * 4 + here;
    models[13] =
        ((Join(3, inwards, at(1, -1)) * 4 + CoarserPrevious(column, row)) * 4 + c.here) * kMemoryStates + state;
    contexts_.weight_sets[0] = (at(-1, 0) * 3 + c.here % 3) * kMemoryStates + state;
    contexts_.refinement = (inwards * 4 + c.here) * 4 + here;
  }

  std::uint32_t CoarserPrevious(std::int32_t column, std::int32_t row) const {
    if (!context_.coarser || !context_.coarser_previous) return kNotCovered;
    const std::int32_t x = context_.columns->index[static_cast<std::size_t>(column)];
    const std::int32_t y = context_.rows->index[static_cast<std::size_t>(row)];
    return x < 0 || y < 0 ? kNotCovered : LastCell(*context_.coarser_previous->At(x, y));
  }

  // Those of many cells, of each of which only one bit counts: is it known, or is it a hazard?
  void SetTemplates(const Neighbours& at, const Coarser& c, const std::uint8_t* previous) {
    const std::uint32_t least = contexts_.decision == Decision::kIsKnown ? 1 : 2;
    const auto bit = [least](std::uint32_t cell) { return cell >= least ? 1u : 0u; };
    const std::uint32_t inwards = Join(2, bit(at(-1, 0)), bit(at(0, -1)));
    contexts_.models[2] =
        Join(2, inwards, bit(at(-1, -1)), bit(at(1, -1)), bit(at(-2, 0)), bit(at(0, -2)), bit(at(2, -1)),
             bit(at(1, -2)), bit(at(-1, -2)), bit(at(-2, -1)), bit(at(3, -1)), bit(at(-3, 0)));
    contexts_.models[9] = Join(2, inwards, bit(c.here % 3), bit(c.east), bit(c.south), bit(c.south_east), bit(c.west),
                               bit(c.north), bit(c.north_east), bit(c.south_west), bit(c.north_west)) *
                              4 +
                          c.sub();
    if (!previous) return;
    const Neighbours before(previous, quadrant_, context_.previous->stride());
    std::uint32_t around = inwards;
    for (int row = -1; row <= 1; ++row) {
      for (int column = -1; column <= 1; ++column)
        around = around * 2 + bit(LastOrUnknown(static_cast<CellMemory>(before(column, row))));
    }
    contexts_.models[12] = around * 4 + c.here;
  }

  const LayerContext& context_;
  const RayTable& rays_;
  const CellPlane& source_;
  Coder& coder_;
  BitModel& model_;
  CellPlane& cells_;
  Quadrant quadrant_;
  BitContexts contexts_;
};

}  // namespace

template <typename Coder>
void CodeLayer(const LayerContext& context, const RayTable& rays, const CellPlane& source, Coder& coder,
               BitModel& model, CellPlane& cells) {
  LayerCoder<Coder>(context, rays, source, coder, model, cells).Run();
}

template void CodeLayer(const LayerContext&, const RayTable&, const CellPlane&, RangeEncoder&, BitModel&, CellPlane&);
template void CodeLayer(const LayerContext&, const RayTable&, const CellPlane&, RangeDecoder&, BitModel&, CellPlane&);

}  // namespace moondb
