#include "actors/sharing/coding/placement.h"

#include <algorithm>
#include <array>

namespace moondb {

namespace {

constexpr int kPlaceBits = 20;  // Fractional bits of a position in cells.

// Makes a table of sines for a quarter turn, by 256 rotations of 1/1024 turn. Computes in units of 1/2^30; the entries
// are in units of 1/2^kRotationBits.
constexpr std::array<std::int32_t, kTurn / 4 + 1> MakeSines() {
  constexpr std::int64_t kOne = 1 << 30;
  // Cosine and sine of 1/1024 turn.
  constexpr std::int64_t kCosine = 1073721611;
  constexpr std::int64_t kSine = 6588356;
  std::array<std::int32_t, kTurn / 4 + 1> sines{};
  std::int64_t cosine = kOne;
  std::int64_t sine = 0;
  for (std::int32_t& entry : sines) {
    entry = static_cast<std::int32_t>((sine + (1 << (29 - kRotationBits))) >> (30 - kRotationBits));
    const std::int64_t next = (cosine * kCosine - sine * kSine) >> 30;
    sine = (sine * kCosine + cosine * kSine) >> 30;
    cosine = next;
  }
  return sines;
}

constexpr std::array<std::int32_t, kTurn / 4 + 1> kSines = MakeSines();

std::int64_t Sine(std::int32_t yaw) {
  const std::int32_t within = yaw & (kTurn / 2 - 1);
  const std::int32_t size = kSines[static_cast<std::size_t>(std::min(within, kTurn / 2 - within))];
  return (yaw & (kTurn / 2)) != 0 ? -size : size;
}

// The grid of a later layer as seen on an earlier layer: the position of the middle of cell (0, 0), and the step to the
// next cell. All values are in units of 1/2^kPlaceBits cells of the earlier layer.
struct GridWalk {
  std::int64_t x = 0, y = 0;
  std::int64_t step_x = 0, step_y = 0;  // Step to the next column. The step to the next row is (-step_y, step_x).
};

GridWalk MakeGridWalk(const CodedLayer& earlier, const CodedLayer& later, std::uint32_t unit_um,
                      const MapPlacement& placement) {
  const Rotation rotation = RotationOf(placement.yaw);
  const std::int64_t from = later.resolution_um;
  const std::int64_t to = earlier.resolution_um;
  // Lengths are in half micrometres; rotated lengths are also scaled by 2^kRotationBits. `cells` converts a position in
  // the earlier map's frame to cells from the earlier layer's corner.
  const std::int64_t x0 = (1 - later.cells.width()) * from;
  const std::int64_t y0 = (1 - later.cells.height()) * from;
  const auto cells = [to](std::int64_t twice_um, std::int64_t shift_um, std::int32_t side) {
    const std::int64_t from_corner = twice_um + ((shift_um + side * to) << kRotationBits);
    return (from_corner << (kPlaceBits - kRotationBits)) / (2 * to);
  };
  GridWalk walk;
  walk.x = cells(rotation.cosine * x0 - rotation.sine * y0, std::int64_t{placement.x} * unit_um, earlier.cells.width());
  walk.y =
      cells(rotation.sine * x0 + rotation.cosine * y0, std::int64_t{placement.y} * unit_um, earlier.cells.height());
  walk.step_x = ((rotation.cosine * from) << (kPlaceBits - kRotationBits)) / to;
  walk.step_y = ((rotation.sine * from) << (kPlaceBits - kRotationBits)) / to;
  return walk;
}

// Writes the memory of an earlier layer to each cell of `placed` whose middle lies on the earlier layer.
void Overlay(const CodedLayer& earlier, const GridWalk& walk, CellPlane& placed) {
  const std::uint64_t width = static_cast<std::uint64_t>(earlier.cells.width());
  const std::uint64_t height = static_cast<std::uint64_t>(earlier.cells.height());
  for (std::int32_t row = 0; row < placed.height(); ++row) {
    std::int64_t x = walk.x - row * walk.step_y;
    std::int64_t y = walk.y + row * walk.step_x;
    std::uint8_t* cell = placed.At(0, row);
    for (std::int32_t column = 0; column < placed.width(); ++column, x += walk.step_x, y += walk.step_y) {
      const std::int64_t from_column = x >> kPlaceBits;
      const std::int64_t from_row = y >> kPlaceBits;
      if (static_cast<std::uint64_t>(from_column) >= width || static_cast<std::uint64_t>(from_row) >= height) continue;
      cell[column] = *earlier.memory.At(static_cast<std::int32_t>(from_column), static_cast<std::int32_t>(from_row));
    }
  }
}

}  // namespace

Rotation RotationOf(std::int32_t yaw) { return {Sine((yaw + kTurn / 4) & (kTurn - 1)), Sine(yaw & (kTurn - 1))}; }

CellPlane Place(const CodedLayers& earlier, const CodedLayer& later, std::uint32_t unit_um,
                const MapPlacement& placement) {
  CellPlane placed(later.cells.width(), later.cells.height());
  for (std::int32_t row = 0; row < placed.height(); ++row) {
    std::fill_n(placed.At(0, row), placed.width(), kNoMemory);
  }
  for (auto layer = earlier.rbegin(); layer != earlier.rend(); ++layer) {
    if (layer->resolution_um < later.resolution_um) break;
    Overlay(*layer, MakeGridWalk(*layer, later, unit_um, placement), placed);
  }
  return placed;
}

}  // namespace moondb
