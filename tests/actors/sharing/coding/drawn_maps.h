// Maps for the tests of the map codec: adversarial maps, random maps, and maps like those of a robot.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "model/grid.h"

namespace moondb {

using Layers = std::vector<MapLayer>;

// Returns layers with cell sizes of 5 cm, 10 cm, 20 cm and so on. `draw(layer, column, row)` returns the value of a
// cell.
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

// Returns maps that a codec may fail on: uniform maps, checkerboards, single cells, single rows and columns, odd side
// lengths, one or eight layers, layers of different or equal resolutions.
std::vector<Layers> AdversarialMaps();

// Returns a map with random sizes, layers and resolutions. Its cells range from noise to large blobs.
Layers RandomMap(std::mt19937_64& rng);

// Returns a map of a room with posts, as a robot with this position and heading in the room might see it. `seed`
// determines the posts. Each layer has `cells` x `cells` cells.
Layers RoomMap(std::uint64_t seed, double x_m, double y_m, double yaw_rad, int layer_count = 4, int cells = 64);

}  // namespace moondb
