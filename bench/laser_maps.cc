#include "bench/laser_maps.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/moondb_mission/random.h"
#include "bench/building.h"

namespace moondb {

namespace {

constexpr double kMarch_m = 0.0125;    // Step along a beam in the search for the wall that the beam hits.
constexpr double kCross_m = 0.02;      // Step along a beam for marking the cells that the beam crosses.
constexpr double kStrayShare = 0.002;  // Fraction of beams that end too early, at a small object in the air.
constexpr double kDriveStep_m = 0.1;
constexpr int kDriveTriesMax = 400;

struct Laser {
  int beam_count = 180;
  double field_of_view_rad = std::numbers::pi;
  double range_m = 20;
  double sigma_m = 0.01;
  int scan_count = 1;
  double scan_spacing_m = 0.1;
  bool is_free_at_range = false;  // True if a beam that hits nothing also marks the cells that it crosses as free.
  // True if a beam may pass diagonally between two cells that touch only at a corner, without marking a third cell.
  bool has_thin_lines = false;
  int layer_count = 4;
  int cells_per_side = 100;
  double resolution_m = 0.05;
};

struct Planar {
  double x = 0, y = 0, yaw = 0;
};

Planar operator*(const Planar& a, const Planar& b) {
  return {a.x + std::cos(a.yaw) * b.x - std::sin(a.yaw) * b.y, a.y + std::sin(a.yaw) * b.x + std::cos(a.yaw) * b.y,
          a.yaw + b.yaw};
}

Laser DrawLaser(Random& random) {
  Laser laser;
  if (random.Chance(0.4)) laser.field_of_view_rad = random.Uniform(1.5, 2 * std::numbers::pi);
  const double beams_per_half_turn = random.Chance(0.4) ? 180 : random.Uniform(150, 720);
  laser.beam_count = static_cast<int>(laser.field_of_view_rad / std::numbers::pi * beams_per_half_turn);
  laser.range_m = random.Chance(0.5) ? random.Uniform(8, 20) : random.Uniform(20, 60);
  laser.sigma_m = random.Uniform(0.003, 0.03);
  if (!random.Chance(0.3)) laser.scan_count = 1 + random.Index(10);
  laser.scan_spacing_m = random.Uniform(0.02, 0.3);
  laser.is_free_at_range = random.Chance(0.5);
  laser.has_thin_lines = random.Chance(0.7);
  if (random.Chance(0.2)) laser.layer_count = 1 + random.Index(5);
  if (random.Chance(0.2)) laser.cells_per_side = 60 + random.Index(70);
  return laser;
}

class Scanner {
 public:
  Scanner(const Building& building, const Laser& laser, Random& random)
      : building_(building), laser_(laser), random_(random) {}

  TraversabilityMap Map(const Planar& pose) {
    map_ = {};
    for (int i = 0; i < laser_.layer_count; ++i) {
      map_.layers.push_back({Grid(laser_.cells_per_side, laser_.cells_per_side),
                             static_cast<std::uint32_t>(std::lround(laser_.resolution_m * 1e6)) << i, 0, 0});
    }
    for (int i = laser_.scan_count; i-- > 0;) {
      const double back_m = i * laser_.scan_spacing_m;
      const Planar sensor{-back_m, 0.02 * back_m * random_.Normal(), 0.05 * i * random_.Normal()};
      const Planar there = pose * sensor;
      if (i == 0 || !building_.IsSolid(there.x, there.y)) Scan(there, sensor);
    }
    return map_;
  }

 private:
  void Scan(const Planar& world, const Planar& sensor) {
    for (int i = 0; i < laser_.beam_count; ++i) {
      const double angle = laser_.field_of_view_rad * ((i + 0.5) / laser_.beam_count - 0.5);
      double range_m = Range(world, world.yaw + angle);
      bool is_hit = range_m < laser_.range_m;
      if (random_.Chance(kStrayShare)) {
        range_m *= random_.Uniform();
        is_hit = true;
      }
      if (is_hit || laser_.is_free_at_range) {
        Enter(sensor, sensor.yaw + angle, range_m + laser_.sigma_m * random_.Normal(), is_hit);
      }
    }
  }

  double Range(const Planar& world, double angle) const {
    double range_m = 0;
    while (range_m < laser_.range_m &&
           !building_.IsSolid(world.x + range_m * std::cos(angle), world.y + range_m * std::sin(angle))) {
      range_m += kMarch_m;
    }
    return range_m;
  }

  void Enter(const Planar& from, double angle, double range_m, bool is_hit) {
    const double end_x = from.x + range_m * std::cos(angle);
    const double end_y = from.y + range_m * std::sin(angle);
    for (MapLayer& layer : map_.layers) {
      if (laser_.has_thin_lines) {
        DrawThinLine(from.x, from.y, end_x, end_y, layer);
      } else {
        for (double m = 0; m < range_m; m += kCross_m) {
          Mark(layer, Index(layer, from.x + m * std::cos(angle)), Index(layer, from.y + m * std::sin(angle)),
               Cell::kFree);
        }
      }
      if (is_hit) Mark(layer, Index(layer, end_x), Index(layer, end_y), Cell::kHazard);
    }
  }

  static void DrawThinLine(double from_x, double from_y, double to_x, double to_y, MapLayer& layer) {
    const int first_column = Index(layer, from_x), first_row = Index(layer, from_y);
    const int columns = Index(layer, to_x) - first_column, rows = Index(layer, to_y) - first_row;
    const int steps = std::max({std::abs(columns), std::abs(rows), 1});
    for (int i = 0; i < steps; ++i) {
      const double share = static_cast<double>(i) / steps;
      Mark(layer, first_column + static_cast<int>(std::lround(columns * share)),
           first_row + static_cast<int>(std::lround(rows * share)), Cell::kFree);
    }
  }

  // Returns the index of the column (or row) that contains the coordinate `metres`. Coordinates begin at the layer's
  // middle.
  static int Index(const MapLayer& layer, double metres) {
    return static_cast<int>(std::floor(metres * 1e6 / layer.resolution_um));
  }

  static void Mark(MapLayer& layer, int column, int row, Cell cell) {
    column += layer.grid.width / 2;
    row += layer.grid.height / 2;
    if (column < 0 || row < 0 || column >= layer.grid.width || row >= layer.grid.height) return;
    Cell& there = layer.grid.At(column, row);
    there = std::max(there, cell);
  }

  const Building& building_;
  const Laser& laser_;
  Random& random_;
  TraversabilityMap map_;
};

Planar DrawStart(const Building& building, Random& random) {
  const double half_m = Building::kSide_m / 2 - 1;
  Planar pose;
  do {
    pose = {random.Uniform(-half_m, half_m), random.Uniform(-half_m, half_m),
            random.Uniform(-std::numbers::pi, std::numbers::pi)};
  } while (!building.HasRoomAt(pose.x, pose.y));
  return pose;
}

void Drive(const Building& building, double metres, Random& random, Planar& pose) {
  for (int tries = 0; metres > 0 && tries < kDriveTriesMax; ++tries) {
    const Planar next = pose * Planar{kDriveStep_m, 0, 0};
    if (building.HasRoomAt(next.x, next.y)) {
      pose = next;
      pose.yaw += 0.06 * random.Normal();
      metres -= kDriveStep_m;
    } else {
      pose.yaw += 0.6 * random.Normal();
    }
  }
}

}  // namespace

std::vector<TraversabilityMap> MakeLaserMaps(std::uint64_t seed, int count) {
  Random random(seed);
  const Building building = Building::Make(random);
  const Laser laser = DrawLaser(random);
  Scanner scanner(building, laser, random);
  Planar pose = DrawStart(building, random);
  const double step_m = random.Uniform(0.2, 2.0);
  std::vector<TraversabilityMap> maps;
  for (int i = 0; i < count; ++i) {
    maps.push_back(scanner.Map(pose));
    Drive(building, step_m, random, pose);
  }
  return maps;
}

std::vector<LaserMap> MakeLaserDrives(std::uint64_t seed, int rover_count, int map_count, double step_m) {
  Random random(seed);
  const Building building = Building::Make(random);
  Laser laser;
  laser.beam_count = 360;
  laser.field_of_view_rad = 1.5 * std::numbers::pi;
  laser.range_m = 10;
  laser.scan_count = 3;
  laser.is_free_at_range = true;
  std::vector<LaserMap> maps;
  for (int rover = 1; rover <= rover_count; ++rover) {
    Scanner scanner(building, laser, random);
    Planar pose = DrawStart(building, random);
    for (int i = 0; i < map_count; ++i) {
      const NodeKey node{static_cast<AgentId>(rover), static_cast<std::uint64_t>(i)};
      maps.push_back({node, Pose::FromPlanar(pose.x, pose.y, pose.yaw), scanner.Map(pose)});
      Drive(building, step_m, random, pose);
    }
  }
  return maps;
}

}  // namespace moondb
