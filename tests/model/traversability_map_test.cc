#include "model/traversability_map.h"

#include <gtest/gtest.h>

#include <random>

namespace moondb {
namespace {

TEST(TraversabilityMapTest, PacksFourCellsAByteLowestFirst) {
  Grid grid(5, 1);
  grid.At(0, 0) = Cell::kFree;
  grid.At(1, 0) = Cell::kHazard;
  grid.At(4, 0) = Cell::kHazard;
  EXPECT_EQ(PackCells(grid), std::string("\x09\x02"));
}

TEST(TraversabilityMapTest, RefusesBytesThatAreNoGrid) {
  EXPECT_FALSE(UnpackCells(5, 1, std::string("\x09")).has_value());
  EXPECT_FALSE(UnpackCells(5, 1, std::string("\x09\x03")).has_value()) << "a cell of value 3";
  EXPECT_FALSE(UnpackCells(5, 1, std::string("\x09\x12")).has_value()) << "spare bits";
  EXPECT_FALSE(UnpackCells(-1, 1, std::string()).has_value());
}

TEST(TraversabilityMapTest, SurvivesItsRecord) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 rng(seed);
  for (int round = 0; round < 50; ++round) {
    TraversabilityMap map{NodeKey{1 + static_cast<AgentId>(rng() % 4), rng()}, Pose::FromPlanar(1.5, -2, 0.7), {}};
    for (std::uint32_t l = 0; l <= rng() % 8; ++l) {
      MapLayer layer{Grid(1 + rng() % 40, 1 + rng() % 40), 50'000u << l, 0.25 * l, -0.5};
      for (Cell& cell : layer.grid.cells) cell = static_cast<Cell>(rng() % 3);
      map.layers.push_back(layer);
    }
    const Result<TraversabilityMap> back = FromProto(ToProto(map));
    ASSERT_TRUE(back.has_value()) << ToString(back.error());
    ASSERT_EQ(back->layers.size(), map.layers.size());
    EXPECT_EQ(back->node, map.node);
    for (std::size_t l = 0; l < map.layers.size(); ++l) {
      EXPECT_EQ(back->layers[l].grid, map.layers[l].grid);
      EXPECT_EQ(back->layers[l].resolution_um, map.layers[l].resolution_um);
      EXPECT_EQ(back->layers[l].center_x_m, map.layers[l].center_x_m);
    }
  }
}

TEST(TraversabilityMapTest, RefusesALayerFinerThanTheOneBeforeIt) {
  TraversabilityMap map{NodeKey{1, 1}, Pose(), {}};
  map.layers.push_back(MapLayer{Grid(1, 1), 100'000, 0, 0});
  map.layers.push_back(MapLayer{Grid(1, 1), 50'000, 0, 0});
  const Result<TraversabilityMap> read = FromProto(ToProto(map));
  ASSERT_FALSE(read.has_value());
  EXPECT_EQ(read.error().field, "layers[1].resolution_um");
}

}  // namespace
}  // namespace moondb
