// CellPlane: the cells of one layer with a margin of unknown cells, so access to a cell's neighbours needs no bounds
// checks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace moondb {

class CellPlane {
 public:
  static constexpr std::int32_t kMargin = 4;

  CellPlane() = default;
  CellPlane(std::int32_t width, std::int32_t height)
      : width_(width),
        height_(height),
        stride_(width + 2 * kMargin),
        cells_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height + 2 * kMargin)) {}

  // Requires: column and row are at least -kMargin, and less than the width or height plus kMargin.
  std::uint8_t* At(std::int32_t column, std::int32_t row) { return cells_.data() + Offset(column, row); }
  const std::uint8_t* At(std::int32_t column, std::int32_t row) const { return cells_.data() + Offset(column, row); }

  std::int32_t width() const { return width_; }
  std::int32_t height() const { return height_; }
  std::int32_t stride() const { return stride_; }

 private:
  std::ptrdiff_t Offset(std::int32_t column, std::int32_t row) const {
    return static_cast<std::ptrdiff_t>(row + kMargin) * stride_ + column + kMargin;
  }

  std::int32_t width_ = 0;
  std::int32_t height_ = 0;
  std::int32_t stride_ = 2 * kMargin;
  std::vector<std::uint8_t> cells_;
};

}  // namespace moondb
