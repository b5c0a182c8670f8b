#include "drawn_maps.h"

#include <algorithm>
#include <cmath>

namespace moondb {

std::vector<Layers> AdversarialMaps() {
  const auto all = [](Cell cell) { return [cell](int, int, int) { return cell; }; };
  const auto checkered = [](int, int column, int row) { return (column + row) % 2 == 0 ? Cell::kFree : Cell::kHazard; };
  const auto striped = [](int layer, int column, int row) { return static_cast<Cell>((layer + column + 2 * row) % 3); };
  std::vector<Layers> maps;
  for (const Cell cell : {Cell::kUnknown, Cell::kFree, Cell::kHazard}) maps.push_back(DrawLayers(4, 20, 20, all(cell)));
  maps.push_back(DrawLayers(4, 24, 24, checkered));
  for (const Cell cell : {Cell::kUnknown, Cell::kFree, Cell::kHazard}) maps.push_back(DrawLayers(1, 1, 1, all(cell)));
  maps.push_back(DrawLayers(3, 57, 1, striped));
  maps.push_back(DrawLayers(3, 1, 57, striped));
  maps.push_back(DrawLayers(3, 17, 31, striped));
  maps.push_back(DrawLayers(1, 33, 32, checkered));
  maps.push_back(DrawLayers(8, 9, 9, striped));
  Layers mixed = DrawLayers(3, 12, 10, striped);
  mixed[0].resolution_um = 1;
  mixed[1] = {Grid(3, 40, Cell::kHazard), 700'001, 0.5, -2};
  mixed[2] = {Grid(50, 2, Cell::kFree), kMapResolutionUmMax, 0, 0};
  maps.push_back(mixed);
  Layers same = DrawLayers(2, 16, 16, checkered);
  same[1].resolution_um = same[0].resolution_um;
  maps.push_back(same);
  return maps;
}

Layers RandomMap(std::mt19937_64& rng) {
  const auto below = [&rng](int count) { return static_cast<int>(rng() % static_cast<std::uint64_t>(count)); };
  const int side_max = below(10) == 0 ? 60 : 16;
  const bool is_noise = below(2) == 0;
  const int period = 2 + below(9);
  const int shares[] = {below(100), below(100)};
  Layers layers = DrawLayers(
      1 + below(below(5) == 0 ? 8 : 4), 1 + below(side_max), 1 + below(side_max), [&](int layer, int column, int row) {
        if (is_noise) {
          const int drawn = below(100);
          return drawn < shares[0] ? Cell::kUnknown : drawn < shares[1] ? Cell::kHazard : Cell::kFree;
        }
        if (below(50) == 0) return static_cast<Cell>(below(3));
        return static_cast<Cell>(((column << layer) / period + (row << layer) / period) % 3);
      });
  if (below(4) == 0) {
    for (MapLayer& layer : layers) layer.resolution_um = 1 + static_cast<std::uint32_t>(below(kMapResolutionUmMax));
  }
  if (below(4) == 0) layers.back().grid = Grid(1 + below(side_max), 1 + below(side_max), static_cast<Cell>(below(3)));
  return layers;
}

Layers RoomMap(std::uint64_t seed, double x_m, double y_m, double yaw_rad, int layer_count, int cells) {
  constexpr double kHalfRoom_m = 4;
  std::mt19937_64 rng(seed);
  std::vector<std::pair<double, double>> posts;
  for (int i = 0; i < 12; ++i) posts.push_back({rng() % 800 / 100.0 - 4, rng() % 800 / 100.0 - 4});
  return DrawLayers(layer_count, cells, cells, [&](int layer, int column, int row) {
    const double cell_m = 0.05 * (1 << layer);
    const double ahead = (column + 0.5 - cells / 2.0) * cell_m;
    const double left = (row + 0.5 - cells / 2.0) * cell_m;
    const double x = x_m + ahead * std::cos(yaw_rad) - left * std::sin(yaw_rad);
    const double y = y_m + ahead * std::sin(yaw_rad) + left * std::cos(yaw_rad);
    const double outside = std::max(std::abs(x), std::abs(y)) - kHalfRoom_m;
    if (outside > cell_m + 0.1) return Cell::kUnknown;
    if (outside > 0) return Cell::kHazard;
    const bool is_post = std::any_of(posts.begin(), posts.end(), [&](const auto& post) {
      return std::hypot(x - post.first, y - post.second) < 0.2 + cell_m / 2;
    });
    return is_post ? Cell::kHazard : Cell::kFree;
  });
}

}  // namespace moondb
