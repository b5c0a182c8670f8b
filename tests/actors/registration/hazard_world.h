// Worlds of round rocks and straight walls, and local maps of them, for tests of registration.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

#include "model/geometry.h"
#include "model/traversability_map.h"

namespace moondb {

struct Rock {
  Eigen::Vector2d center_m;
  double radius_m = 0.2;
};

struct Wall {
  Eigen::Vector2d from_m;
  Eigen::Vector2d to_m;
};

struct HazardWorld {
  std::vector<Rock> rocks;
  std::vector<Wall> walls;
  double wall_half_m = 0.05;

  // A square of rocks of random places and sizes, centred at the origin.
  static HazardWorld OfRocks(std::uint64_t seed, int count, double side_m = 16) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> place(-side_m / 2, side_m / 2);
    std::uniform_real_distribution<double> radius(0.1, 0.4);
    HazardWorld world;
    for (int i = 0; i < count; ++i) {
      const double x_m = place(random);
      const double y_m = place(random);
      world.rocks.push_back({{x_m, y_m}, radius(random)});
    }
    return world;
  }

  // A square building of random walls at right angles, with round posts, centred at the origin.
  static HazardWorld OfRooms(std::uint64_t seed, double side_m = 40, double walls_per_m2 = 0.0375) {
    std::mt19937_64 random(seed);
    const double half_m = side_m / 2;
    std::uniform_real_distribution<double> place(-half_m, half_m);
    std::uniform_real_distribution<double> length(2, 7);
    HazardWorld world;
    const Eigen::Vector2d corners[] = {{-half_m, -half_m}, {half_m, -half_m}, {half_m, half_m}, {-half_m, half_m}};
    for (int i = 0; i < 4; ++i) world.walls.push_back({corners[i], corners[(i + 1) % 4]});
    const int wall_count = static_cast<int>(walls_per_m2 * side_m * side_m);
    for (int i = 0; i < wall_count; ++i) {
      const Eigen::Vector2d from_m(place(random), place(random));
      const double length_m = length(random);
      const Eigen::Vector2d along_m = i % 2 == 0 ? Eigen::Vector2d(length_m, 0) : Eigen::Vector2d(0, length_m);
      world.walls.push_back({from_m, from_m + along_m});
    }
    for (int i = 0; i < 30; ++i) {
      const double x_m = place(random);
      world.rocks.push_back({{x_m, place(random)}, 0.2});
    }
    return world;
  }

  bool IsHazard(const Eigen::Vector2d& point_m, double margin_m) const {
    for (const Rock& rock : rocks) {
      if ((point_m - rock.center_m).norm() <= rock.radius_m + margin_m) return true;
    }
    for (const Wall& wall : walls) {
      const Eigen::Vector2d along = wall.to_m - wall.from_m;
      const double t = std::clamp((point_m - wall.from_m).dot(along) / along.squaredNorm(), 0.0, 1.0);
      if ((wall.from_m + t * along - point_m).norm() <= wall_half_m + margin_m) return true;
    }
    return false;
  }

  MapLayer LayerAt(const Pose& map_from_local, std::uint32_t resolution_um, int side_cells) const {
    MapLayer layer;
    layer.resolution_um = resolution_um;
    layer.grid = Grid(side_cells, side_cells);
    const double resolution_m = resolution_um * 1e-6;
    for (int row = 0; row < side_cells; ++row) {
      for (int column = 0; column < side_cells; ++column) {
        const Eigen::Vector3d point_m((column + 0.5 - side_cells / 2.0) * resolution_m,
                                      (row + 0.5 - side_cells / 2.0) * resolution_m, 0);
        const bool is_hazard = IsHazard((map_from_local * point_m).head<2>(), resolution_m / 4);
        layer.grid.At(column, row) = is_hazard ? Cell::kHazard : Cell::kFree;
      }
    }
    return layer;
  }

  // A map with layers of 100 x 100 cells at 5 cm and at 10 cm.
  TraversabilityMap MapAt(const Pose& map_from_local, const NodeKey& node = {1, 0}) const {
    TraversabilityMap map;
    map.node = node;
    map.layers = {LayerAt(map_from_local, 50'000, 100), LayerAt(map_from_local, 100'000, 100)};
    return map;
  }
};

}  // namespace moondb
