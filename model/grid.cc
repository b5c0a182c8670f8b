#include "model/grid.h"

#include <algorithm>

#include "model/check.h"

namespace moondb {

namespace {

constexpr std::size_t kCellsPerByte = 4;

std::size_t PackedSize(std::size_t cell_count) { return (cell_count + kCellsPerByte - 1) / kCellsPerByte; }

}  // namespace

Grid::Grid(std::int32_t w, std::int32_t h, Cell fill)
    : width(w), height(h), cells(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), fill) {
  Check(w >= 0 && h >= 0, "a grid's sides are not negative");
}

MergedMap CroppedToKnown(const MergedMap& map, std::int32_t margin_cells) {
  std::int32_t left = map.grid.width, right = -1, bottom = map.grid.height, top = -1;
  for (std::int32_t row = 0; row < map.grid.height; ++row) {
    for (std::int32_t column = 0; column < map.grid.width; ++column) {
      if (map.grid.At(column, row) == Cell::kUnknown) continue;
      left = std::min(left, column);
      right = std::max(right, column);
      bottom = std::min(bottom, row);
      top = std::max(top, row);
    }
  }
  if (right < 0) return map;
  left = std::max(0, left - margin_cells);
  bottom = std::max(0, bottom - margin_cells);
  right = std::min(map.grid.width - 1, right + margin_cells);
  top = std::min(map.grid.height - 1, top + margin_cells);
  MergedMap part{Grid(right - left + 1, top - bottom + 1), map.resolution_um, map.origin_cell_x + left,
                 map.origin_cell_y + bottom};
  for (std::int32_t row = bottom; row <= top; ++row) {
    for (std::int32_t column = left; column <= right; ++column) {
      part.grid.At(column - left, row - bottom) = map.grid.At(column, row);
    }
  }
  return part;
}

std::string PackCells(const Grid& grid) {
  std::string bytes(PackedSize(grid.cells.size()), '\0');
  for (std::size_t i = 0; i < grid.cells.size(); ++i) {
    const auto shift = 2 * (i % kCellsPerByte);
    bytes[i / kCellsPerByte] = static_cast<char>(bytes[i / kCellsPerByte] | (static_cast<int>(grid.cells[i]) << shift));
  }
  return bytes;
}

Result<Grid> UnpackCells(std::int32_t width, std::int32_t height, std::string_view bytes) {
  if (width < 0 || height < 0) return Fail(ErrorCode::kInvalid, "has a negative side");
  const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (bytes.size() != PackedSize(count)) {
    return Fail(ErrorCode::kInvalid, "has " + std::to_string(bytes.size()) + " bytes, but " + std::to_string(width) +
                                         " x " + std::to_string(height) + " cells need " +
                                         std::to_string(PackedSize(count)));
  }
  Grid grid(width, height);
  for (std::size_t i = 0; i < count; ++i) {
    const int value = (static_cast<unsigned char>(bytes[i / kCellsPerByte]) >> (2 * (i % kCellsPerByte))) & 3;
    if (value == 3) return Fail(ErrorCode::kInvalid, "cell " + std::to_string(i) + " has the value 3");
    grid.cells[i] = static_cast<Cell>(value);
  }
  const std::size_t used = count % kCellsPerByte;
  if (used != 0 && static_cast<unsigned char>(bytes.back()) >> (2 * used) != 0) {
    return Fail(ErrorCode::kInvalid, "has bits set after its last cell");
  }
  return grid;
}

}  // namespace moondb
