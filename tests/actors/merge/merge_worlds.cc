#include "tests/actors/merge/merge_worlds.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <tuple>
#include <utility>

#include "model/check.h"

namespace moondb {
namespace {

double Uniform(std::mt19937_64& rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(rng);
}

int Dice(std::mt19937_64& rng, int sides) { return std::uniform_int_distribution<int>(0, sides - 1)(rng); }

Pose RandomPose(std::mt19937_64& rng, double x_m, double y_m, double reach_m) {
  const double yaw = Dice(rng, 3) == 0 ? Dice(rng, 4) * M_PI_2 : Uniform(rng, -4, 4);
  Pose pose = Pose::FromPlanar(x_m + Uniform(rng, -reach_m, reach_m), y_m + Uniform(rng, -reach_m, reach_m), yaw);
  if (Dice(rng, 2) == 0) {
    const Eigen::AngleAxisd tilt(Uniform(rng, -0.3, 0.3), Eigen::Vector3d(Uniform(rng, -1, 1), 1, 0).normalized());
    pose.orientation = pose.orientation * Eigen::Quaterniond(tilt);
    pose.position_m.z() = Uniform(rng, -5, 5);
  }
  return pose;
}

// Right angles and half cells put cell centres exactly on borders, where half-open intervals show.
Pose AlignedPose(std::mt19937_64& rng, double x_m, double y_m, double half_cell_m) {
  const auto snap = [&](double around_m) { return (std::round(around_m / half_cell_m) + Dice(rng, 80)) * half_cell_m; };
  return Pose::FromPlanar(snap(x_m), snap(y_m), Dice(rng, 4) * M_PI_2);
}

Grid RandomGrid(std::mt19937_64& rng) {
  int width = 1 + Dice(rng, 60);
  int height = Dice(rng, 2) == 0 ? width : 1 + Dice(rng, 60);
  if (Dice(rng, 8) == 0) width = 1;
  if (Dice(rng, 40) == 0) height = 513 + Dice(rng, 600);
  Grid grid(width, height);
  const int unknown = Dice(rng, 11);  // In tenths.
  for (Cell& cell : grid.cells) {
    if (Dice(rng, 10) >= unknown) cell = Dice(rng, 3) == 0 ? Cell::kHazard : Cell::kFree;
  }
  return grid;
}

MapLayer RandomLayer(std::mt19937_64& rng, std::uint32_t grid_um, bool is_aligned) {
  MapLayer layer;
  layer.grid = RandomGrid(rng);
  const double ratio = std::exp2(Uniform(rng, -3, 3));
  layer.resolution_um =
      is_aligned || Dice(rng, 2) == 0 ? grid_um << Dice(rng, 4) : static_cast<std::uint32_t>(grid_um * ratio);
  // Large layers are fine ones, so that worlds stay small.
  if (layer.grid.height > 512) layer.resolution_um = grid_um / 4;
  if (!is_aligned && Dice(rng, 2) == 0) {
    layer.center_x_m = Uniform(rng, -1, 1);
    layer.center_y_m = Uniform(rng, -1, 1);
  }
  return layer;
}

struct Observation {
  std::int64_t column = 0;
  std::int64_t row = 0;
  bool is_inside = false;
};

Observation Ask(const PlacedRectangle& placed, std::int64_t x, std::int64_t y) {
  const std::int64_t i = x - placed.anchor_x;
  const std::int64_t j = y - placed.anchor_y;
  const std::int64_t u = placed.u0 + i * placed.step_cos + j * placed.step_sin;
  const std::int64_t v = placed.v0 - i * placed.step_sin + j * placed.step_cos;
  Observation seen;
  seen.is_inside = u >= 0 && u < std::int64_t{placed.width_q} && v >= 0 && v < std::int64_t{placed.height_q};
  if (seen.is_inside) {
    seen.column = u / (1 << 22);
    seen.row = v / (1 << 22);
  }
  return seen;
}

// Larger is better. The map's own order of layers and blocks comes last.
using Key = std::tuple<std::int64_t, std::int64_t, AgentId, RecordKey, int, std::int64_t, std::int64_t>;

Key KeyOf(const LocalMap& map, const LayerBlock& block) {
  return {-std::int64_t{map.map.layers[block.level].resolution_um},
          map.stamp_ns,
          map.agent(),
          map.key,
          -block.level,
          -block.row,
          -block.column};
}

// A planar pose by angles.
struct Turned {
  long double x = 0;
  long double y = 0;
  long double cos_yaw = 1;
  long double sin_yaw = 0;
};

Turned Flatten(const Pose& pose) {
  const Eigen::Vector3d ahead = pose.orientation.toRotationMatrix().col(0);
  const long double yaw = std::atan2(static_cast<long double>(ahead.y()), static_cast<long double>(ahead.x()));
  return {pose.position_m.x(), pose.position_m.y(), std::cos(yaw), std::sin(yaw)};
}

// Coordinates in a rectangle's cells, from its lower left corner.
std::pair<long double, long double> Locate(const Turned& frame, const MapLayer& layer, long double x_m,
                                           long double y_m) {
  const long double dx = x_m - frame.x;
  const long double dy = y_m - frame.y;
  const long double cell_m = layer.resolution_um / 1e6L;
  const long double in_x = frame.cos_yaw * dx + frame.sin_yaw * dy - layer.center_x_m;
  const long double in_y = frame.cos_yaw * dy - frame.sin_yaw * dx - layer.center_y_m;
  return {in_x / cell_m + layer.grid.width / 2.0L, in_y / cell_m + layer.grid.height / 2.0L};
}

bool IsNearBorder(long double coordinate, long double margin) {
  return std::abs(coordinate - std::round(coordinate)) < margin;
}

}  // namespace

TraversabilityMap DrawMap(const std::vector<std::string>& rows, std::uint32_t resolution_um, AgentId agent) {
  MapLayer layer;
  layer.grid = Grid(static_cast<std::int32_t>(rows[0].size()), static_cast<std::int32_t>(rows.size()));
  for (std::int32_t row = 0; row < layer.grid.height; ++row) {
    const std::string& text = rows[rows.size() - 1 - static_cast<std::size_t>(row)];
    for (std::int32_t column = 0; column < layer.grid.width; ++column) {
      const char cell = text[static_cast<std::size_t>(column)];
      layer.grid.At(column, row) = cell == '#' ? Cell::kHazard : cell == '.' ? Cell::kFree : Cell::kUnknown;
    }
  }
  layer.resolution_um = resolution_um;
  layer.center_x_m = layer.grid.width * (resolution_um / 2e6);
  layer.center_y_m = layer.grid.height * (resolution_um / 2e6);
  return {NodeKey{agent, 1}, Pose{}, {layer}};
}

std::vector<std::string> Print(const MergedMap& merged) {
  std::vector<std::string> rows;
  for (std::int32_t row = merged.grid.height - 1; row >= 0; --row) {
    std::string text;
    for (std::int32_t column = 0; column < merged.grid.width; ++column) {
      text += " .#"[static_cast<std::size_t>(merged.grid.At(column, row))];
    }
    rows.push_back(text);
  }
  return rows;
}

RecordKey MapKey(AgentId agent, std::uint64_t seq) { return {{agent, 7, proto::LOCAL_TRAVERSABILITY_MAP}, seq}; }

World MakeRandomWorld(std::mt19937_64& rng) {
  World world;
  const std::uint32_t resolutions[] = {50'000, 100'000, 37'000};
  world.grid.resolution_um = resolutions[Dice(rng, 3)];
  const double far_m = Dice(rng, 3) == 0 ? 1e6 : 0;
  const double x_m = far_m == 0 ? 0 : far_m + Uniform(rng, 0, 1);
  const double y_m = far_m == 0 ? 0 : -far_m + Uniform(rng, 0, 1);
  const bool is_aligned = Dice(rng, 3) == 0;
  const double half_cell_m = world.grid.resolution_um / 2e6;
  const auto random_pose = [&] {
    return is_aligned ? AlignedPose(rng, x_m, y_m, half_cell_m) : RandomPose(rng, x_m, y_m, 3);
  };
  const int map_count = 1 + Dice(rng, 8);
  for (int i = 0; i < map_count; ++i) {
    TraversabilityMap map;
    const AgentId agent = 1 + static_cast<AgentId>(Dice(rng, 3));
    map.node = {agent, static_cast<std::uint64_t>(i)};
    if (!is_aligned) map.node_from_map = RandomPose(rng, 0, 0, 0.5);
    const int layer_count = 1 + Dice(rng, 4);
    for (int k = 0; k < layer_count; ++k) map.layers.push_back(RandomLayer(rng, world.grid.resolution_um, is_aligned));
    auto local = MakeLocalMap(MapKey(agent, static_cast<std::uint64_t>(i + 1)), Dice(rng, 3), map, world.grid);
    Check(local.has_value(), "a random map is valid");
    world.maps.push_back({*local, random_pose()});
  }
  const int footprint_count = Dice(rng, 6);
  for (int i = 0; i < footprint_count; ++i) world.footprints.push_back(random_pose());
  return world;
}

MergeResult MergeByBruteForce(const MapPlacement& placement) {
  MergeResult result = MakeEmptyResult(placement);
  const CellBox& extent = placement.extent;
  std::size_t at = 0;
  for (std::int64_t y = extent.first_y; y <= extent.last_y; ++y) {
    for (std::int64_t x = extent.first_x; x <= extent.last_x; ++x, ++at) {
      Key best;
      bool has_best = false;
      for (const PlacedBlock& placed : placement.blocks) {
        const Observation seen = Ask(placed.rectangle, x, y);
        if (!seen.is_inside) continue;
        const LocalMap& map = *placement.slots[placed.slot].map;
        const Cell cell =
            map.map.layers[placed.block.level].grid.At(placed.block.column + static_cast<std::int32_t>(seen.column),
                                                       placed.block.row + static_cast<std::int32_t>(seen.row));
        const Key key = KeyOf(map, placed.block);
        if (cell == Cell::kUnknown || (has_best && key < best)) continue;
        best = key;
        has_best = true;
        result.merged.grid.cells[at] = cell;
        result.slots[at] = placed.slot;
        result.levels[at] = placed.block.level;
      }
      for (const PlacedRectangle& footprint : placement.footprints) {
        if (!Ask(footprint, x, y).is_inside) continue;
        result.merged.grid.cells[at] = Cell::kFree;
        result.slots[at] = kNoSlot;
        result.levels[at] = kFootprintLevel;
      }
    }
  }
  return result;
}

GeometricMerge MergeByGeometry(const World& world, const CellBox& extent, long double margin_cells) {
  GeometricMerge merge;
  const long double grid_m = world.grid.resolution_um / 1e6L;
  MapLayer footprint;  // Only its cells' size counts: footprints are measured in cells of the grid.
  footprint.resolution_um = world.grid.resolution_um;
  const long double length = world.grid.footprint_length_m / grid_m;
  const long double width = world.grid.footprint_width_m / grid_m;
  std::vector<Turned> frames;
  for (const PlacedMap& placed : world.maps) {
    frames.push_back(Flatten(placed.map_from_node * placed.map->map.node_from_map));
  }
  std::vector<Turned> bodies;
  for (const Pose& pose : world.footprints) bodies.push_back(Flatten(pose));
  for (std::int64_t y = extent.first_y; y <= extent.last_y; ++y) {
    for (std::int64_t x = extent.first_x; x <= extent.last_x; ++x) {
      const long double x_m = (x + 0.5L) * grid_m;
      const long double y_m = (y + 0.5L) * grid_m;
      Cell value = Cell::kUnknown;
      bool is_certain = true;
      Key best;
      for (std::size_t i = 0; i < world.maps.size(); ++i) {
        const LocalMap& map = *world.maps[i].map;
        for (std::size_t level = 0; level < map.map.layers.size(); ++level) {
          const MapLayer& layer = map.map.layers[level];
          const auto [u, v] = Locate(frames[i], layer, x_m, y_m);
          if (u < -1 || v < -1 || u > layer.grid.width + 1 || v > layer.grid.height + 1) continue;
          if (IsNearBorder(u, margin_cells) || IsNearBorder(v, margin_cells)) is_certain = false;
          if (u < 0 || v < 0 || u >= layer.grid.width || v >= layer.grid.height) continue;
          const Cell cell = layer.grid.At(static_cast<std::int32_t>(u), static_cast<std::int32_t>(v));
          const Key key = KeyOf(map, {static_cast<std::uint8_t>(level), 0, 0, 0, 0});
          if (cell == Cell::kUnknown || (value != Cell::kUnknown && key < best)) continue;
          best = key;
          value = cell;
        }
      }
      for (const Turned& body : bodies) {
        const auto [u, v] = Locate(body, footprint, x_m, y_m);
        const long double to_side = std::min(length / 2 - std::abs(u), width / 2 - std::abs(v));
        if (std::abs(to_side) < margin_cells) is_certain = false;
        if (to_side > 0) value = Cell::kFree;
      }
      merge.cells.push_back(value);
      merge.is_certain.push_back(is_certain);
    }
  }
  return merge;
}

}  // namespace moondb
