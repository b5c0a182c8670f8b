#include "bench/merge_world.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace moondb {
namespace {

constexpr int kSide = 128;
constexpr int kLayers = 4;
constexpr std::uint32_t kFinest_um = 50'000;

struct Wedge {
  float from_rad = 0;
  float to_rad = 0;
  float from_m = 0;
};

// Polar coordinates of each cell of a layer, relative to the layer's middle.
struct Polar {
  std::vector<float> angle_rad;
  std::vector<float> distance_cells;
};

Polar MakePolar() {
  Polar polar;
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const float x = static_cast<float>(column) + 0.5f - kSide / 2.0f;
      const float y = static_cast<float>(row) + 0.5f - kSide / 2.0f;
      polar.angle_rad.push_back(std::atan2(y, x));
      polar.distance_cells.push_back(std::hypot(x, y));
    }
  }
  return polar;
}

MapLayer MakeLayer(int level, const std::vector<Wedge>& wedges, const Polar& polar, std::mt19937_64& rng) {
  MapLayer layer;
  layer.resolution_um = kFinest_um << level;
  layer.grid = Grid(kSide, kSide);
  const float cell_m = static_cast<float>(layer.resolution_um) / 1e6f;
  for (std::size_t i = 0; i < layer.grid.cells.size(); ++i) {
    const float distance_m = polar.distance_cells[i] * cell_m;
    const float angle_rad = polar.angle_rad[i];
    const auto is_in = [&](const Wedge& wedge) {
      return distance_m > wedge.from_m && angle_rad > wedge.from_rad && angle_rad < wedge.to_rad;
    };
    const auto noise = static_cast<unsigned>(rng() % 100);
    if (polar.distance_cells[i] > kSide / 2.0f || noise < 3) continue;
    if (std::any_of(wedges.begin(), wedges.end(), is_in)) continue;
    layer.grid.cells[i] = noise < 20 ? Cell::kHazard : Cell::kFree;
  }
  return layer;
}

}  // namespace

MergeWorld MakeMergeWorld(std::size_t map_count, std::int64_t side_cells, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  const auto uniform = [&rng](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng);
  };
  static const Polar polar = MakePolar();
  MergeWorld world;
  world.grid.resolution_um = kFinest_um;
  world.grid.pages_max = 16'384;  // Measure maps larger than those that an agent merges.
  const double side_m = static_cast<double>(side_cells) * kFinest_um / 1e6;
  const double reach_m = (kSide / 2.0) * (kFinest_um << (kLayers - 1)) / 1e6;
  for (std::size_t i = 0; i < map_count; ++i) {
    std::vector<Wedge> wedges;
    for (int k = 0; k < 8; ++k) {
      const double from_rad = uniform(-M_PI, M_PI);
      wedges.push_back({static_cast<float>(from_rad), static_cast<float>(from_rad + uniform(0.05, 0.4)),
                        static_cast<float>(uniform(0.5, 6))});
    }
    const AgentId agent = 1 + static_cast<AgentId>(i % 3);
    MapAtPose map;
    map.key = NumberedMapKey(agent, i + 1);
    map.timestamp_ns = static_cast<std::int64_t>(i / 3);
    map.map_from_node =
        Pose::FromPlanar(uniform(reach_m, side_m - reach_m), uniform(reach_m, side_m - reach_m), uniform(-M_PI, M_PI));
    map.map.node = {agent, i};
    for (int level = 0; level < kLayers; ++level) map.map.layers.push_back(MakeLayer(level, wedges, polar, rng));
    world.footprints.push_back(map.map_from_node);
    world.maps.push_back(std::move(map));
  }
  return world;
}

}  // namespace moondb
