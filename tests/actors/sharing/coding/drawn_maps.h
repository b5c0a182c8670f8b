// Maps for the codec's tests: adversarial ones, random ones and some that look like a robot's.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "model/grid.h"

namespace moondb {

using Layers = std::vector<MapLayer>;

// Layers that double their resolution from 5 cm; `draw` gives each cell by layer, column and row.
template <typename Draw>
Layers DrawLayers(int layer_count, int width, int height, Draw draw) {
  Layers layers;
  for (int i = 0; i < layer_count; ++i) {
    Grid grid(width, height);
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) grid.At(column, row) = draw(i, column, row);
    }
    layers.push_back({std::move(grid), 50'000u << i, 0, 0});
  }
  return layers;
}

// Named in the order of the cases: all unknown, all free, all hazards, a checkerboard, one cell, one row, one column,
// odd sides, one layer, eight layers, layers of other sizes and resolutions.
std::vector<Layers> AdversarialMaps();

// Of any form: sizes, layers, resolutions, and cells from noise to large blots.
Layers RandomMap(std::mt19937_64& rng);

// What a robot might see from (x, y) in metres at that heading in a room with posts, whatever `seed` makes of it.
Layers RoomMap(std::uint64_t seed, double x_m, double y_m, double yaw_rad, int layer_count = 4, int cells = 64);

}  // namespace moondb
