// The building in which ros_robot drives, in metres.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/geometry.h"

namespace moondb {

struct Wall {
  Eigen::Vector2d a;
  Eigen::Vector2d b;
};

// A building of 16 x 10 m: a corridor, three rooms off it, and furniture that makes each room unlike the others.
inline std::vector<Wall> Building() {
  std::vector<Wall> walls;
  const auto add = [&walls](double ax, double ay, double bx, double by) { walls.push_back({{ax, ay}, {bx, by}}); };
  const auto box = [&add](double x, double y, double width, double height) {
    add(x, y, x + width, y);
    add(x + width, y, x + width, y + height);
    add(x + width, y + height, x, y + height);
    add(x, y + height, x, y);
  };
  box(0, 0, 16, 10);
  add(0, 4, 2, 4), add(3.4, 4, 7.5, 4), add(8.9, 4, 13, 4),
      add(14.4, 4, 16, 4);                         // The corridor's wall with three openings.
  add(5, 4, 5, 10), add(11, 4, 11, 10);            // Between the rooms.
  box(0.4, 8.2, 1.6, 0.8), box(3.6, 6, 0.5, 0.5);  // A table and a pillar.
  box(6, 8.5, 3, 0.6), box(9.8, 5.2, 0.6, 1.8);
  box(11.6, 6.4, 0.9, 0.9), box(14.2, 8.6, 1.4, 0.5), box(13.2, 5.4, 0.4, 0.4);
  box(5.2, 0.5, 0.7, 0.7), box(10.4, 1.2, 1.2, 0.4), box(1.2, 1.4, 0.5, 1);
  return walls;
}

// The ways of three robots, which cross in the corridor.
inline std::vector<Eigen::Vector2d> WayOf(int robot) {
  if (robot == 2)
    return {{8.2, 6}, {7, 7.5}, {9, 7.6}, {8.2, 4}, {8.2, 2.4}, {13.6, 2.6}, {13.7, 6}, {13.7, 3}, {8.2, 2.6}};
  if (robot == 3)
    return {{13.7, 7.6}, {14.8, 7.2}, {13.7, 5}, {13.7, 2.6}, {8.2, 2.8}, {2.7, 2.6}, {2.7, 6}, {2.7, 3}, {13.7, 3}};
  return {{2.7, 6}, {1.4, 7}, {3, 8.4}, {2.7, 4}, {2.8, 2.6}, {8.2, 2.6}, {8.2, 6.6}, {8.2, 3}, {2.7, 2.8}};
}

// Range from a scanner at `from` to the nearest wall, at most `range_max_m`.
inline double RangeTo(const std::vector<Wall>& walls, const Eigen::Vector2d& from, double angle_rad,
                      double range_max_m) {
  const Eigen::Vector2d way(std::cos(angle_rad), std::sin(angle_rad));
  double nearest_m = range_max_m;
  for (const Wall& wall : walls) {
    const Eigen::Vector2d along = wall.b - wall.a;
    const double det = way.x() * -along.y() + way.y() * along.x();
    if (std::abs(det) < 1e-9) continue;
    const Eigen::Vector2d to = wall.a - from;
    const double range_m = (to.x() * -along.y() + to.y() * along.x()) / det;
    const double part = (way.x() * to.y() - way.y() * to.x()) / det;
    if (range_m > 0 && part >= 0 && part <= 1) nearest_m = std::min(nearest_m, range_m);
  }
  return nearest_m;
}

}  // namespace moondb
