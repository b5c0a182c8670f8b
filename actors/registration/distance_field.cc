#include "actors/registration/distance_field.h"

#include <algorithm>
#include <array>

#include "model/check.h"

namespace moondb {

// First measures along the columns, then along the rows.
DistanceField::DistanceField(std::span<const Cell> cells, const SquareGrid& grid, double reach_m)
    : grid_(grid), reach_m_(reach_m), units_(cells.size()), known_(cells.size()) {
  const int side = grid_.side_cells;
  Check(side % 2 == 0 && cells.size() == grid_.cell_count(), "the field is a square");
  const int reach = static_cast<int>(reach_m / grid_.cell_m + 0.5);
  Check(reach > 0 && reach <= kReachMax, "the reach fits the squares of distances");
  const auto far = static_cast<std::uint16_t>(reach * reach);
  std::vector<std::uint16_t> along_columns(cells.size(), far);  // Squared distances in cells.
  for (int x = 0; x < side; ++x) {
    const auto scan = [&](int begin, int end, int step) {
      int distance = reach;
      for (int y = begin; y != end; y += step) {
        const std::size_t at = grid_.IndexOf(x, y);
        distance = cells[at] == Cell::kHazard ? 0 : std::min(distance + 1, reach);
        along_columns[at] = std::min(along_columns[at], static_cast<std::uint16_t>(distance * distance));
      }
    };
    scan(0, side, 1);
    scan(side - 1, -1, -1);
  }
  std::array<std::uint8_t, kReachMax * kReachMax + 1> rounded;
  for (std::size_t i = 0; i < rounded.size(); ++i) {
    rounded[i] = static_cast<std::uint8_t>(std::lround(kUnits * std::sqrt(static_cast<double>(i))));
  }
  std::vector<std::uint16_t> row(static_cast<std::size_t>(side));
  for (int y = 0; y < side; ++y) {
    const std::uint16_t* const from = &along_columns[grid_.IndexOf(0, y)];
    std::copy(from, from + side, row.begin());
    for (int shift = 1; shift < reach; ++shift) {
      const auto add = static_cast<std::uint16_t>(shift * shift);
      for (int x = 0; x + shift < side; ++x) {
        row[x] = std::min(row[x], static_cast<std::uint16_t>(from[x + shift] + add));
      }
      for (int x = shift; x < side; ++x) {
        row[x] = std::min(row[x], static_cast<std::uint16_t>(from[x - shift] + add));
      }
    }
    for (int x = 0; x < side; ++x) units_[grid_.IndexOf(x, y)] = rounded[row[x]];
  }
  for (std::size_t i = 0; i < cells.size(); ++i) known_[i] = cells[i] != Cell::kUnknown;
}

DistanceField::Distance DistanceField::At(const Eigen::Vector2d& point_m) const {
  const Eigen::Vector2d at = point_m / grid_.cell_m + Eigen::Vector2d::Constant(grid_.side_cells / 2 - 0.5);
  const int x = static_cast<int>(std::floor(at.x()));
  const int y = static_cast<int>(std::floor(at.y()));
  if (x < 0 || y < 0 || x + 1 >= grid_.side_cells || y + 1 >= grid_.side_cells) return {.distance_m = reach_m_};
  const double fx = at.x() - x;
  const double fy = at.y() - y;
  const double unit_m = grid_.cell_m / kUnits;
  const double d00 = units_[grid_.IndexOf(x, y)] * unit_m;
  const double d10 = units_[grid_.IndexOf(x + 1, y)] * unit_m;
  const double d01 = units_[grid_.IndexOf(x, y + 1)] * unit_m;
  const double d11 = units_[grid_.IndexOf(x + 1, y + 1)] * unit_m;
  Distance result;
  result.distance_m = (1 - fy) * ((1 - fx) * d00 + fx * d10) + fy * ((1 - fx) * d01 + fx * d11);
  result.gradient =
      Eigen::Vector2d((1 - fy) * (d10 - d00) + fy * (d11 - d01), (1 - fx) * (d01 - d00) + fx * (d11 - d10)) /
      grid_.cell_m;
  result.is_known = known_[grid_.IndexOf(static_cast<int>(at.x() + 0.5), static_cast<int>(at.y() + 0.5))];
  return result;
}

}  // namespace moondb
