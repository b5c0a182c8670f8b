#include "bench/rolling_maps.h"

#include <algorithm>
#include <cmath>

#include "apps/moondb_mission/random.h"
#include "apps/moondb_mission/terrain.h"

namespace moondb {

namespace {

constexpr std::uint32_t kFinest_um = 50'000;

// The terrain's hazards as a grid with the cell size of one layer.
class WorldLayer {
 public:
  WorldLayer(const MergedMap& finest, int layer)
      : shift_(layer), side_(finest.grid.width >> layer), grid_(side_, side_) {
    for (int row = 0; row < side_ << layer; ++row) {
      for (int column = 0; column < side_ << layer; ++column) {
        Cell& cell = grid_.At(column >> layer, row >> layer);
        cell = std::max(cell, finest.grid.At(column, row));
      }
    }
  }

  // Finds the cell of this layer that contains the finest layer's cell (`finest_column`, `finest_row`), and returns the
  // cell that lies `column` columns and `row` rows further. Outside the world, returns the nearest border cell.
  Cell At(int finest_column, int finest_row, int column, int row) const {
    return grid_.At(std::clamp((finest_column >> shift_) + column, 0, side_ - 1),
                    std::clamp((finest_row >> shift_) + row, 0, side_ - 1));
  }

 private:
  int shift_;
  int side_;
  Grid grid_;
};

Cell OtherThan(Cell cell, Random& random) {
  return static_cast<Cell>((static_cast<int>(cell) + 1 + random.Index(2)) % 3);
}

}  // namespace

std::vector<TraversabilityMap> MakeRollingMaps(const RollingOptions& options) {
  Random random(options.seed);
  TerrainOptions terrain;
  terrain.side_m = 100;
  const MergedMap finest = Terrain::Make(terrain, random).HazardMap();
  std::vector<WorldLayer> world;
  for (int i = 0; i < options.layer_count; ++i) world.emplace_back(finest, i);
  const int middle = finest.grid.width / 2;
  // Maps move by multiples of the coarsest cell, which are whole cells in every layer.
  const int coarsest = 1 << (options.layer_count - 1);
  double x_m = 0, y_m = 0, heading_rad = random.Uniform(0, 6);
  std::vector<TraversabilityMap> maps;
  for (int i = 0; i < options.map_count; ++i) {
    const auto cell_at = [&](double metres) {
      return middle + static_cast<int>(std::lround(metres / kTerrainCell_m / coarsest)) * coarsest;
    };
    TraversabilityMap map;
    for (int layer = 0; layer < options.layer_count; ++layer) {
      Grid grid(options.cells_per_side, options.cells_per_side);
      for (int row = 0; row < grid.height; ++row) {
        for (int column = 0; column < grid.width; ++column) {
          const Cell cell = world[static_cast<std::size_t>(layer)].At(cell_at(x_m), cell_at(y_m),
                                                                      column - grid.width / 2, row - grid.height / 2);
          grid.At(column, row) = random.Chance(options.noise_share) ? OtherThan(cell, random) : cell;
        }
      }
      map.layers.push_back({std::move(grid), kFinest_um << layer, 0, 0});
    }
    maps.push_back(std::move(map));
    x_m += options.step_m * std::cos(heading_rad);
    y_m += options.step_m * std::sin(heading_rad);
    heading_rad += 0.1 * random.Normal();
  }
  return maps;
}

}  // namespace moondb
