// RouteMap: the places where a rover's centre may be without a hazard under its body, and the paths between them.
//
// The explored square is a grid of 0.25 m cells. A cell is open if every point of the cell is farther than the rover's
// radius from all hazards, and the cell is not at the edge of the square. Every point of an open cell is therefore safe
// at any heading. Immutable once made.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "apps/moondb_mission/terrain.h"

namespace moondb {

inline constexpr double kRouteCell_m = 0.25;

struct Disc {
  Eigen::Vector2d center_m = Eigen::Vector2d::Zero();
  double radius_m = 0;
};

class RouteMap {
 public:
  // For each cell: the length of the shortest path from the start of FindWays (infinite if there is no path), and the
  // cell's predecessor on that path.
  struct Ways {
    std::vector<float> length_m;
    std::vector<int> previous;
  };

  RouteMap(const Terrain& terrain, double rover_radius_m);

  int cell_count() const { return side_cells_ * side_cells_; }
  Eigen::Vector2d CenterOf(int cell) const;
  int CellOf(const Eigen::Vector2d& point_m) const;  // Index of the cell. -1: outside the grid.
  bool IsOpen(const Eigen::Vector2d& point_m) const;
  bool IsOpenLine(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) const;

  // Finds the shortest paths from `from_m` to all cells by Dijkstra's algorithm over eight neighbours. Paths do not
  // enter the discs in `avoid`, but may start inside one.
  Ways FindWays(const Eigen::Vector2d& from_m, const std::vector<Disc>& avoid) const;

  // Returns the centres of the cells on the path from the start of `ways` to `goal`, without the start. Empty if there
  // is no path.
  std::vector<Eigen::Vector2d> RouteTo(int goal, const Ways& ways) const;

 private:
  int side_cells_;
  double half_m_;
  std::vector<char> is_open_;
};

}  // namespace moondb
