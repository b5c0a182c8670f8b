// Maps for the codec's tests: adversarial ones, random ones, and some that resemble a robot's maps.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "model/grid.h"

namespace moondb {

using Layers = std::vector<MapLayer>;

// Returns layers with resolutions of 5 cm, 10 cm, 20 cm and so on. `draw` returns the cell at a layer, column and row.
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

// Maps in this order: all unknown, all free, all hazards, a checkerboard, one cell, one row, one column, odd side
// lengths, one layer, eight layers, layers of different sizes and resolutions.
std::vector<Layers> AdversarialMaps();

// A map with random sizes, layers and resolutions. Its cells range from noise to large blobs.
Layers RandomMap(std::mt19937_64& rng);

// The map that a robot at (x, y) in metres with this heading might see of a room with posts. `seed` determines the
// room.
Layers RoomMap(std::uint64_t seed, double x_m, double y_m, double yaw_rad, int layer_count = 4, int cells = 64);

}  // namespace moondb
