// RayTable: where each cell of a layer lies about the layer's centre, where the sensor mostly stands.
//
// What a cell is depends most on the cells between it and the sensor. By symmetry one quadrant is enough.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace moondb {

class RayTable {
 public:
  static constexpr std::size_t kSteps = 3;

  struct Ray {
    // The cells 1, 2 and 3 steps nearer to the centre: so many columns inwards, 0 to 3, and 4 times as many rows.
    std::array<std::uint8_t, kSteps> cells_in;
    std::uint8_t bearing;   // Within the quadrant, 0 to 7.
    std::uint8_t distance;  // A class, 0 to 7.
  };

  RayTable() = default;
  RayTable(std::int32_t width, std::int32_t height);

  bool IsFor(std::int32_t width, std::int32_t height) const { return width == width_ && height == height_; }
  // Rays of one row, by the number of columns from the centre.
  const Ray* RowAt(std::int32_t rows_out) const { return rays_.data() + static_cast<std::size_t>(rows_out) * columns_; }

 private:
  std::int32_t width_ = 0;
  std::int32_t height_ = 0;
  std::size_t columns_ = 0;
  std::vector<Ray> rays_;
};

}  // namespace moondb
