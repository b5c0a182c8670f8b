#include "actors/sharing/coding/ray_table.h"

#include <algorithm>

namespace moondb {

namespace {

// Limits of the distance classes, in cells.
constexpr std::array<std::int32_t, 7> kDistanceLimits = {2, 4, 8, 14, 22, 32, 44};

// Returns the ray of a cell. `x` and `y` are the distances from the centre to the cell's middle, in half cells.
RayTable::Ray MakeRay(std::int32_t x, std::int32_t y) {
  RayTable::Ray ray{};
  const std::int32_t longer = std::max({x, y, 1});
  for (std::size_t i = 0; i < RayTable::kSteps; ++i) {
    const std::int32_t steps = static_cast<std::int32_t>(i) + 1;
    const std::int32_t columns_in = (2 * steps * x + longer) / (2 * longer);
    const std::int32_t rows_in = (2 * steps * y + longer) / (2 * longer);
    ray.cells_in[i] = static_cast<std::uint8_t>(columns_in + 4 * rows_in);
  }
  const std::int32_t slope = std::min(x, y) * 4 / (longer + 1);
  ray.bearing = static_cast<std::uint8_t>((y > x ? 4 : 0) + slope);
  const auto* limit = std::upper_bound(kDistanceLimits.begin(), kDistanceLimits.end(), longer / 2);
  ray.distance = static_cast<std::uint8_t>(limit - kDistanceLimits.begin());
  return ray;
}

}  // namespace

RayTable::RayTable(std::int32_t width, std::int32_t height)
    : width_(width), height_(height), columns_(static_cast<std::size_t>(width + 1) / 2) {
  const std::int32_t rows = (height + 1) / 2;
  rays_.reserve(columns_ * static_cast<std::size_t>(rows));
  for (std::int32_t row = 0; row < rows; ++row) {
    for (std::int32_t column = 0; column < static_cast<std::int32_t>(columns_); ++column) {
      rays_.push_back(MakeRay(2 * column + 1 - width % 2, 2 * row + 1 - height % 2));
    }
  }
}

}  // namespace moondb
