#include "actors/merge/cpu_merger.h"

#include <algorithm>

namespace moondb {
namespace {

struct Span {
  std::int64_t first = 0;
  std::int64_t last = -1;
};

std::int64_t FloorDivide(std::int64_t a, std::int64_t b) { return a / b - (a % b != 0 && (a < 0) != (b < 0) ? 1 : 0); }
std::int64_t CeilDivide(std::int64_t a, std::int64_t b) { return -FloorDivide(-a, b); }

// Keeps the i with 0 <= start + i * step < limit.
void Clip(std::int64_t start, std::int64_t step, std::int64_t limit, Span& span) {
  if (step == 0) {
    if (start < 0 || start >= limit) span = {};
    return;
  }
  const std::int64_t to_low = step > 0 ? CeilDivide(-start, step) : CeilDivide(limit - 1 - start, step);
  const std::int64_t to_high = step > 0 ? FloorDivide(limit - 1 - start, step) : FloorDivide(-start, step);
  span.first = std::max(span.first, to_low);
  span.last = std::min(span.last, to_high);
}

// Calls visit(first x, last x, y, u, v) for each row of the grid that the rectangle covers, u and v at first x. The
// clipping is exact in integers, so nothing is tested cell by cell.
template <typename Visit>
void ForEachRow(const PlacedRectangle& placed, Visit visit) {
  for (std::int64_t y = placed.box.first_y; y <= placed.box.last_y; ++y) {
    const std::int64_t j = y - placed.anchor_y;
    const std::int64_t u = placed.u0 + j * placed.step_sin;
    const std::int64_t v = placed.v0 + j * placed.step_cos;
    Span span{placed.box.first_x - placed.anchor_x, placed.box.last_x - placed.anchor_x};
    Clip(u, placed.step_cos, placed.width_q, span);
    Clip(v, -static_cast<std::int64_t>(placed.step_sin), placed.height_q, span);
    if (span.last < span.first) continue;
    visit(placed.anchor_x + span.first, placed.anchor_x + span.last, y,
          static_cast<std::uint32_t>(u + span.first * placed.step_cos),
          static_cast<std::uint32_t>(v - span.first * placed.step_sin));
  }
}

// The rows of a result, by the merged map's own cells.
class Canvas {
 public:
  Canvas(const CellBox& extent, MergeResult& result) : extent_(extent), result_(result) {}

  void DrawFootprint(const PlacedRectangle& placed) {
    ForEachRow(placed, [this](std::int64_t first, std::int64_t last, std::int64_t y, std::uint32_t, std::uint32_t) {
      const std::size_t at = IndexOf(first, y);
      const auto count = static_cast<std::size_t>(last - first + 1);
      std::fill_n(result_.merged.grid.cells.begin() + static_cast<std::ptrdiff_t>(at), count, Cell::kFree);
      std::fill_n(result_.levels.begin() + static_cast<std::ptrdiff_t>(at), count, kFootprintLevel);
    });
  }

  void DrawBlock(const PlacedBlock& placed, const Grid& layer) {
    const Cell* corner =
        layer.cells.data() + static_cast<std::size_t>(placed.block.row) * layer.width + placed.block.column;
    const auto stride = static_cast<std::size_t>(layer.width);
    const auto step_u = static_cast<std::uint32_t>(placed.rectangle.step_cos);
    const auto step_v = static_cast<std::uint32_t>(-static_cast<std::int64_t>(placed.rectangle.step_sin));
    ForEachRow(placed.rectangle,
               [&](std::int64_t first, std::int64_t last, std::int64_t y, std::uint32_t u, std::uint32_t v) {
                 const std::size_t begin = IndexOf(first, y);
                 const std::size_t end = begin + static_cast<std::size_t>(last - first + 1);
                 Cell* const cells = result_.merged.grid.cells.data();
                 for (std::size_t at = begin; at < end; ++at, u += step_u, v += step_v) {
                   if (cells[at] != Cell::kUnknown) continue;
                   const Cell cell = corner[(v >> kFractionBits) * stride + (u >> kFractionBits)];
                   if (cell == Cell::kUnknown) continue;
                   cells[at] = cell;
                   result_.slots[at] = placed.slot;
                   result_.levels[at] = placed.block.level;
                 }
               });
  }

 private:
  std::size_t IndexOf(std::int64_t x, std::int64_t y) const {
    return static_cast<std::size_t>(y - extent_.first_y) * static_cast<std::size_t>(result_.merged.grid.width) +
           static_cast<std::size_t>(x - extent_.first_x);
  }

  const CellBox& extent_;
  MergeResult& result_;
};

}  // namespace

Result<MergeResult> CpuMerger::Merge(const MapPlacement& placement, const StopPredicate& stop) {
  MergeResult result = MakeEmptyResult(placement);
  Canvas canvas(placement.extent, result);
  for (const PlacedRectangle& footprint : placement.footprints) canvas.DrawFootprint(footprint);
  for (const PlacedBlock& placed : placement.blocks) {
    if (stop && stop()) return Fail(ErrorCode::kUnavailable, "the merge was stopped");
    canvas.DrawBlock(placed, placement.slots[placed.slot].map->map.layers[placed.block.level].grid);
  }
  return result;
}

}  // namespace moondb
