#include "actors/merge/local_map.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

TraversabilityMap MakeRandomMap(std::mt19937_64& rng, std::int32_t width, std::int32_t height) {
  TraversabilityMap map;
  map.node = {1, 1};
  map.layers.push_back({Grid(width, height), 50'000, 0, 0});
  for (Cell& cell : map.layers[0].grid.cells) cell = static_cast<Cell>(rng() % 3);
  return map;
}

TEST(LocalMapTest, KeepsEveryCell) {
  std::mt19937_64 rng(5);
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 513}, {16, 16}, {17, 3}, {130, 127}, {1030, 600}}) {
    const TraversabilityMap map = MakeRandomMap(rng, width, height);
    const auto local = *MakeLocalMap(MapKey(1, 1), 1, map, {});
    for (const PackedBlock& cells : local->blocks) {
      const LayerBlock& block = cells.block();
      for (std::int32_t row = 0; row < block.height; ++row) {
        for (std::int32_t column = 0; column < block.width; ++column) {
          ASSERT_EQ(cells.At(column, row), map.layers[0].grid.At(block.column + column, block.row + row));
        }
      }
    }
  }
}

TEST(LocalMapTest, NeedsLittleMoreThanTwoBitsPerCell) {
  std::mt19937_64 rng(6);
  TraversabilityMap map = MakeRandomMap(rng, 128, 128);
  for (int i = 0; i < 3; ++i) map.layers.push_back(map.layers[0]);
  const auto local = *MakeLocalMap(MapKey(1, 1), 1, map, {});
  EXPECT_LT(local->bytes(), 4 * 128 * 128 / 4 * 1.2);
}

TEST(LocalMapTest, LayersLargerThanABlockAreSplitAndNeighboursShareACell) {
  for (const int width : {511, 512, 513, 1023, 1024, 1500}) {
    TraversabilityMap map;
    map.layers.push_back({Grid(width, 3, Cell::kHazard), 50'000, 0, 0});
    const auto local = *MakeLocalMap(MapKey(1, 1), 1, map, {});
    std::int32_t covered = 0;
    for (const PackedBlock& cells : local->blocks) {
      EXPECT_LE(cells.block().width, kBlockSideCellsMax);
      EXPECT_EQ(cells.block().column, std::max(0, covered - 1));
      covered = cells.block().column + cells.block().width;
    }
    EXPECT_EQ(covered, width);
  }
}

TEST(LocalMapTest, BlocksWithoutAKnownCellAreNotKept) {
  TraversabilityMap map;
  map.layers.push_back({Grid(1000, 10), 50'000, 0, 0});
  map.layers[0].grid.At(999, 0) = Cell::kFree;
  const auto local = *MakeLocalMap(MapKey(1, 1), 1, map, {});
  EXPECT_EQ(local->bounds.size(), 2u);
  ASSERT_EQ(local->blocks.size(), 1u);
  EXPECT_EQ(local->blocks[0].block().column, 511);
}

TEST(LocalMapTest, RefusesCellsTooFineForTheGrid) {
  TraversabilityMap map;
  map.layers.push_back({Grid(4, 4, Cell::kFree), 50'000, 0, 0});
  map.layers.push_back({Grid(4, 4, Cell::kFree), 195, 0, 0});
  const auto local = MakeLocalMap(MapKey(1, 1), 1, map, {});
  ASSERT_FALSE(local.has_value());
  EXPECT_EQ(local.error().code, ErrorCode::kInvalid);
  EXPECT_EQ(local.error().field, "layers[1].resolution_um");
  map.layers[1].resolution_um = 196;
  EXPECT_TRUE(MakeLocalMap(MapKey(1, 1), 1, map, {}).has_value());
}

TEST(LocalMapTest, RefusesAGridThatDoesNotFitTheIntegers) {
  EXPECT_EQ(CheckGrid({.resolution_um = 999}).error().field, "map.resolution_m");
  EXPECT_EQ(CheckGrid({.resolution_um = 1000, .footprint_length_m = 0.513}).error().field, "map.footprint_m");
  EXPECT_EQ(CheckGrid({.footprint_width_m = -1}).error().field, "map.footprint_m");
  EXPECT_EQ(CheckGrid({.side_cells_max = 0}).error().field, "side_cells_max");
  EXPECT_TRUE(CheckGrid({}).has_value());
}

}  // namespace
}  // namespace moondb
