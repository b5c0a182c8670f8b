#include "tests/actors/merge/merge_worlds.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <tuple>
#include <utility>

#include "model/check.h"
#include "proto/types.pb.h"

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

// Returns a pose whose heading is a multiple of 90 degrees and whose position is a multiple of half a cell. Cell
// centres then lie exactly on borders.
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
  const int unknown = Dice(rng, 11);  // Share of unknown cells, in tenths.
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
  // Large layers get small cells, to keep the worlds small.
  if (layer.grid.height > 512) layer.resolution_um = grid_um / 4;
  if (!is_aligned && Dice(rng, 2) == 0) {
    layer.center_x_m = Uniform(rng, -1, 1);
    layer.center_y_m = Uniform(rng, -1, 1);
  }
  return layer;
}

struct Answer {
  std::int64_t column = 0;
  std::int64_t row = 0;
  bool is_inside = false;
};

Answer Ask(const PlacedRectangle& placed, std::int64_t x, std::int64_t y) {
  const std::int64_t i = x - placed.anchor_x;
  const std::int64_t j = y - placed.anchor_y;
  const std::int64_t u = placed.u0 + i * placed.step_cos + j * placed.step_sin;
  const std::int64_t v = placed.v0 - i * placed.step_sin + j * placed.step_cos;
  Answer seen;
  seen.is_inside = u >= 0 && u < std::int64_t{placed.width_q} && v >= 0 && v < std::int64_t{placed.height_q};
  if (seen.is_inside) {
    seen.column = u / (1 << 22);
    seen.row = v / (1 << 22);
  }
  return seen;
}

// Orders cells by priority: of two cells, the cell with the larger key wins. The last three elements order the layers
// and blocks of one map.
using Key = std::tuple<std::int64_t, std::int64_t, AgentId, RecordKey, int, std::int64_t, std::int64_t>;

Key KeyOf(const LocalMap& map, const LayerBlock& block) {
  return {-std::int64_t{map.layers[block.level].resolution_um},
          map.timestamp_ns,
          map.agent(),
          map.key,
          -block.level,
          -block.row,
          -block.column};
}

// Returns the cell's value, or kUnknown if no block covers the cell.
Cell CellOf(const LocalMap& map, std::size_t level, std::int32_t column, std::int32_t row) {
  for (const PackedBlock& cells : map.blocks) {
    const LayerBlock& block = cells.block();
    const std::int32_t in_column = column - block.column;
    const std::int32_t in_row = row - block.row;
    if (block.level != level || in_column < 0 || in_row < 0 || in_column >= block.width || in_row >= block.height) {
      continue;
    }
    return cells.At(in_column, in_row);
  }
  return Cell::kUnknown;
}

// A planar pose with the cosine and sine of its yaw.
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

// Converts (x_m, y_m) to coordinates in cells of the layer, measured from the layer's lower left corner.
std::pair<long double, long double> Locate(const Turned& frame, const LocalLayer& layer, long double x_m,
                                           long double y_m) {
  const long double dx = x_m - frame.x;
  const long double dy = y_m - frame.y;
  const long double cell_m = layer.resolution_um / 1e6L;
  const long double in_x = frame.cos_yaw * dx + frame.sin_yaw * dy - layer.center_x_m;
  const long double in_y = frame.cos_yaw * dy - frame.sin_yaw * dx - layer.center_y_m;
  return {in_x / cell_m + layer.width / 2.0L, in_y / cell_m + layer.height / 2.0L};
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
  for (int i = 0; i < footprint_count; ++i) {
    world.footprints.push_back({{1, static_cast<std::uint64_t>(i)}, random_pose()});
  }
  return world;
}

World MakeFineWorld(std::mt19937_64& rng) {
  World world;
  world.grid.resolution_um = 1'000'000;
  world.grid.footprint_length_m = 150;
  world.grid.footprint_width_m = 4;
  for (std::uint64_t i = 0; i < 6; ++i) {
    TraversabilityMap map;
    map.node = {1, i};
    MapLayer layer;
    const auto width = 1 + Dice(rng, 1100);
    const auto height = 1 + Dice(rng, 600);
    layer.grid = Grid(width, height);
    for (Cell& cell : layer.grid.cells) cell = static_cast<Cell>(Dice(rng, 3));
    layer.resolution_um = 5'000u << Dice(rng, 7);
    map.layers.push_back(std::move(layer));
    const auto local = MakeLocalMap(MapKey(1, i + 1), Dice(rng, 3), map, world.grid);
    Check(local.has_value(), "a random map is valid");
    world.maps.push_back({*local, RandomPose(rng, 0, 0, 100)});
  }
  for (std::uint64_t i = 0; i < 2; ++i) world.footprints.push_back({{1, i}, RandomPose(rng, 0, 0, 100)});
  return world;
}

MergeResult MergeBy(std::shared_ptr<GatherBackend> backend, const World& world) {
  Merger merger(world.grid, std::move(backend));
  Check(merger.Assign(world.maps, world.footprints).empty(), "the world's poses are valid");
  const Result<MergeSummary> merged = merger.Merge({});
  Check(merged.has_value(), "a merge that nothing stops");
  return ReadAll(merger);
}

MergeResult ReadAll(const Merger& merger) {
  Result<MergeResult> result = merger.Read(merger.extent());
  Check(result.has_value(), "a small world can be read");
  return *std::move(result);
}

std::size_t CountDifferences(const MergeResult& a, const MergeResult& b) {
  const std::size_t cells = std::max(a.slots.size(), b.slots.size());
  if (a.merged.grid.width != b.merged.grid.width || a.merged.grid.height != b.merged.grid.height ||
      a.merged.origin_cell_x != b.merged.origin_cell_x || a.merged.origin_cell_y != b.merged.origin_cell_y) {
    return std::max<std::size_t>(cells, 1);
  }
  const auto key = [](const MergeResult& result, std::size_t i) {
    const std::uint32_t slot = result.slots[i];
    return slot == kNoSlot ? RecordKey{} : result.maps[slot].map->key;
  };
  std::size_t count = 0;
  for (std::size_t i = 0; i < cells; ++i) {
    const bool is_same =
        a.merged.grid.cells[i] == b.merged.grid.cells[i] && a.levels[i] == b.levels[i] && key(a, i) == key(b, i);
    if (!is_same) ++count;
  }
  return count;
}

MergeResult MergeByBruteForce(const World& world) {
  // If several maps have the same key, only the first one is merged.
  std::map<RecordKey, std::unique_ptr<PlacedThing>> maps;
  std::map<NodeKey, std::unique_ptr<PlacedThing>> footprints;
  CellBox extent;
  for (const PlacedMap& placed : world.maps) {
    const auto [at, is_new] = maps.emplace(placed.map->key, *PlaceMap(placed, world.grid));
    extent.Add(at->second->extent);
  }
  for (const Footprint& footprint : world.footprints) {
    const auto [at, is_new] = footprints.emplace(footprint.node, *PlaceFootprint(footprint, world.grid));
    extent.Add(at->second->extent);
  }
  MergeResult result;
  result.merged.resolution_um = world.grid.resolution_um;
  result.merged.grid = Grid(static_cast<std::int32_t>(extent.width()), static_cast<std::int32_t>(extent.height()));
  if (!extent.is_empty()) {
    result.merged.origin_cell_x = extent.first_x;
    result.merged.origin_cell_y = extent.first_y;
  }
  for (const auto& [key, thing] : maps) result.maps.push_back(thing->placed);
  result.slots.assign(result.merged.grid.cells.size(), kNoSlot);
  result.levels.assign(result.merged.grid.cells.size(), 0);
  std::size_t at = 0;
  for (std::int64_t y = extent.first_y; y <= extent.last_y; ++y) {
    for (std::int64_t x = extent.first_x; x <= extent.last_x; ++x, ++at) {
      Key best;
      std::uint32_t slot = 0;
      for (const auto& [map_key, thing] : maps) {
        for (const PlacedBlock& placed : thing->blocks) {
          const Answer seen = Ask(placed.rectangle, x, y);
          if (!seen.is_inside) continue;
          const Cell cell =
              placed.cells->At(static_cast<std::int32_t>(seen.column), static_cast<std::int32_t>(seen.row));
          const Key key = KeyOf(*thing->placed.map, placed.cells->block());
          if (cell == Cell::kUnknown || (result.slots[at] != kNoSlot && key < best)) continue;
          best = key;
          result.merged.grid.cells[at] = cell;
          result.slots[at] = slot;
          result.levels[at] = placed.cells->block().level;
        }
        ++slot;
      }
      for (const auto& [node, thing] : footprints) {
        if (thing->blocks.empty() || !Ask(thing->blocks[0].rectangle, x, y).is_inside) continue;
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
  LocalLayer footprint;  // Only its cell size is used, because footprints are measured in cells of the grid.
  footprint.resolution_um = world.grid.resolution_um;
  const long double length = world.grid.footprint_length_m / grid_m;
  const long double width = world.grid.footprint_width_m / grid_m;
  std::vector<Turned> frames;
  for (const PlacedMap& placed : world.maps) {
    frames.push_back(Flatten(placed.map_from_node * placed.map->node_from_map));
  }
  std::vector<Turned> bodies;
  for (const Footprint& placed : world.footprints) bodies.push_back(Flatten(placed.map_from_node));
  for (std::int64_t y = extent.first_y; y <= extent.last_y; ++y) {
    for (std::int64_t x = extent.first_x; x <= extent.last_x; ++x) {
      const long double x_m = (x + 0.5L) * grid_m;
      const long double y_m = (y + 0.5L) * grid_m;
      Cell value = Cell::kUnknown;
      bool is_certain = true;
      Key best;
      for (std::size_t i = 0; i < world.maps.size(); ++i) {
        const LocalMap& map = *world.maps[i].map;
        for (std::size_t level = 0; level < map.layers.size(); ++level) {
          const LocalLayer& layer = map.layers[level];
          const auto [u, v] = Locate(frames[i], layer, x_m, y_m);
          if (u < -1 || v < -1 || u > layer.width + 1 || v > layer.height + 1) continue;
          if (IsNearBorder(u, margin_cells) || IsNearBorder(v, margin_cells)) is_certain = false;
          if (u < 0 || v < 0 || u >= layer.width || v >= layer.height) continue;
          const Cell cell = CellOf(map, level, static_cast<std::int32_t>(u), static_cast<std::int32_t>(v));
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
