// RayTable: for each cell of a layer, its bearing and distance from the layer's centre, where the sensor usually is,
// and the next three cells towards the centre.
//
// A cell's value depends most on the cells between the cell and the sensor. The table covers one quadrant; the other
// quadrants are symmetric.
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
    // Offsets of the cells that are 1, 2 and 3 steps nearer to the centre. An offset is columns + 4 * rows, both
    // counted towards the centre from 0 to 3.
    std::array<std::uint8_t, kSteps> cells_in;
    std::uint8_t bearing;   // Bearing class within the quadrant, 0 to 7.
    std::uint8_t distance;  // Distance class, 0 to 7.
  };

  RayTable() = default;
  RayTable(std::int32_t width, std::int32_t height);

  bool IsFor(std::int32_t width, std::int32_t height) const { return width == width_ && height == height_; }
  // Returns the rays of one row, indexed by the number of columns from the centre.
  const Ray* RowAt(std::int32_t rows_out) const { return rays_.data() + static_cast<std::size_t>(rows_out) * columns_; }

 private:
  std::int32_t width_ = 0;
  std::int32_t height_ = 0;
  std::size_t columns_ = 0;
  std::vector<Ray> rays_;
};

}  // namespace moondb
