// RouteMap: where a rover's middle may be so that no hazard comes under its body, and the ways between such places.
//
// A grid of 0.25 m over the explored square. A cell is open if no hazard lies within the rover's radius of any point of
// it, so that every point of an open cell is safe whatever the heading. Immutable once made.
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
  // Lengths of the shortest ways from one place to all cells (infinite: none), and each cell's predecessor.
  struct Ways {
    std::vector<float> length_m;
    std::vector<int> previous;
  };

  RouteMap(const Terrain& terrain, double rover_radius_m);

  int cell_count() const { return side_cells_ * side_cells_; }
  Eigen::Vector2d CenterOf(int cell) const;
  int CellOf(const Eigen::Vector2d& point_m) const;  // -1 outside.
  bool IsOpen(const Eigen::Vector2d& point_m) const;
  bool IsOpenLine(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m) const;

  // Dijkstra over eight neighbours, around the discs (in which the start may lie).
  Ways FindWays(const Eigen::Vector2d& from_m, const std::vector<Disc>& avoid) const;

  // The cells' middles from the start to `goal`, without the start.
  std::vector<Eigen::Vector2d> RouteTo(int goal, const Ways& ways) const;

 private:
  int side_cells_;
  double half_m_;
  std::vector<char> is_open_;
};

}  // namespace moondb
