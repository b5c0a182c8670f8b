#include "apps/moondb_mission/route_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <queue>
#include <utility>

namespace moondb {

namespace {

constexpr double kLineSample_m = 0.05;
constexpr double kEdge_m = 0.5;  // Rovers keep this distance from the edge of the square.

}  // namespace

RouteMap::RouteMap(const Terrain& terrain, double rover_radius_m)
    : side_cells_(static_cast<int>(std::floor(terrain.options().side_m / kRouteCell_m))),
      half_m_(side_cells_ * kRouteCell_m / 2),
      is_open_(static_cast<std::size_t>(side_cells_) * side_cells_, 1) {
  const double half_diagonals_m = (kRouteCell_m + kTerrainCell_m) * std::numbers::sqrt2 / 2;
  const double reach_m = rover_radius_m + half_diagonals_m;
  const MergedMap hazards = terrain.HazardMap();
  const int reach_cells = static_cast<int>(std::ceil(reach_m / kRouteCell_m));
  for (int row = 0; row < hazards.grid.height; ++row) {
    for (int column = 0; column < hazards.grid.width; ++column) {
      if (hazards.grid.At(column, row) != Cell::kHazard) continue;
      const Eigen::Vector2d hazard((hazards.origin_cell_x + column + 0.5) * kTerrainCell_m,
                                   (hazards.origin_cell_y + row + 0.5) * kTerrainCell_m);
      const int middle_x = static_cast<int>(std::floor((hazard.x() + half_m_) / kRouteCell_m));
      const int middle_y = static_cast<int>(std::floor((hazard.y() + half_m_) / kRouteCell_m));
      for (int y = std::max(0, middle_y - reach_cells); y <= std::min(side_cells_ - 1, middle_y + reach_cells); ++y) {
        for (int x = std::max(0, middle_x - reach_cells); x <= std::min(side_cells_ - 1, middle_x + reach_cells); ++x) {
          const int cell = y * side_cells_ + x;
          if ((CenterOf(cell) - hazard).norm() <= reach_m) is_open_[cell] = 0;
        }
      }
    }
  }
  for (int cell = 0; cell < cell_count(); ++cell) {
    if (CenterOf(cell).cwiseAbs().maxCoeff() > half_m_ - kEdge_m) is_open_[cell] = 0;
  }
}

Eigen::Vector2d RouteMap::CenterOf(int cell) const {
  return {(cell % side_cells_ + 0.5) * kRouteCell_m - half_m_, (cell / side_cells_ + 0.5) * kRouteCell_m - half_m_};
}

int RouteMap::CellOf(const Eigen::Vector2d& point_m) const {
  const int x = static_cast<int>(std::floor((point_m.x() + half_m_) / kRouteCell_m));
  const int y = static_cast<int>(std::floor((point_m.y() + half_m_) / kRouteCell_m));
  return x < 0 || y < 0 || x >= side_cells_ || y >= side_cells_ ? -1 : y * side_cells_ + x;
}

bool RouteMap::IsOpen(const Eigen::Vector2d& point_m) const {
  const int cell = CellOf(point_m);
  return cell >= 0 && is_open_[cell] != 0;
}

bool RouteMap::IsOpenLine(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) const {
  const int samples = 1 + static_cast<int>((to_m - from_m).norm() / kLineSample_m);
  for (int i = 0; i <= samples; ++i) {
    if (!IsOpen(from_m + (to_m - from_m) * (static_cast<double>(i) / samples))) return false;
  }
  return true;
}

RouteMap::Ways RouteMap::FindWays(const Eigen::Vector2d& from_m, const std::vector<Disc>& avoid) const {
  constexpr float kNever = std::numeric_limits<float>::infinity();
  Ways ways{std::vector<float>(cell_count(), kNever), std::vector<int>(cell_count(), -1)};
  const int start = CellOf(from_m);
  if (start < 0) return ways;
  std::vector<char> is_open = is_open_;
  for (int cell = 0; cell < cell_count(); ++cell) {
    for (const Disc& disc : avoid) {
      if ((CenterOf(cell) - disc.center_m).norm() < disc.radius_m) is_open[cell] = 0;
    }
  }
  using Entry = std::pair<float, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  ways.length_m[start] = 0;
  open.emplace(0.0f, start);
  while (!open.empty()) {
    const auto [length_m, cell] = open.top();
    open.pop();
    if (length_m > ways.length_m[cell]) continue;
    const int x = cell % side_cells_;
    const int y = cell / side_cells_;
    for (int next_y = std::max(0, y - 1); next_y <= std::min(side_cells_ - 1, y + 1); ++next_y) {
      for (int next_x = std::max(0, x - 1); next_x <= std::min(side_cells_ - 1, x + 1); ++next_x) {
        const int next = next_y * side_cells_ + next_x;
        // A diagonal step touches two more cells, which must also be open.
        if (!is_open[next] || !is_open[y * side_cells_ + next_x] || !is_open[next_y * side_cells_ + x]) continue;
        const bool is_diagonal = next_x != x && next_y != y;
        const float next_m = length_m + static_cast<float>(kRouteCell_m * (is_diagonal ? std::numbers::sqrt2 : 1.0));
        if (next_m >= ways.length_m[next]) continue;
        ways.length_m[next] = next_m;
        ways.previous[next] = cell;
        open.emplace(next_m, next);
      }
    }
  }
  return ways;
}

std::vector<Eigen::Vector2d> RouteMap::RouteTo(int goal, const Ways& ways) const {
  std::vector<Eigen::Vector2d> route;
  for (int cell = goal; cell >= 0 && ways.previous[cell] >= 0; cell = ways.previous[cell]) {
    route.push_back(CenterOf(cell));
  }
  std::reverse(route.begin(), route.end());
  return route;
}

}  // namespace moondb
