#include "actors/merge/cpu_merger.h"

#include <gtest/gtest.h>

#include <iostream>
#include <random>

#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

TEST(CpuMergerTest, AgreesWithBruteForceInEveryCell) {
  std::mt19937_64 seeds(1);
  for (int round = 0; round < 30; ++round) {
    const std::uint64_t seed = seeds();
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 rng(seed);
    const World world = MakeRandomWorld(rng);
    const Result<MapPlacement> placement = PlaceMaps(world.maps, world.footprints, world.grid);
    ASSERT_TRUE(placement.has_value()) << ToString(placement.error());
    const Result<MergeResult> merged = CpuMerger().Merge(*placement);
    ASSERT_TRUE(merged.has_value());
    ASSERT_TRUE(*merged == MergeByBruteForce(*placement));
  }
}

// Blocks, boxes, anchors and conventions against geometry by angles; only borders are left to rounding.
TEST(CpuMergerTest, AgreesWithGeometryAwayFromBorders) {
  std::mt19937_64 seeds(2);
  std::size_t certain = 0;
  std::size_t known = 0;
  for (int round = 0; round < 8; ++round) {
    const std::uint64_t seed = seeds();
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 rng(seed);
    const World world = MakeRandomWorld(rng);
    const Result<MapPlacement> placement = PlaceMaps(world.maps, world.footprints, world.grid);
    ASSERT_TRUE(placement.has_value());
    const Result<MergeResult> merged = CpuMerger().Merge(*placement);
    ASSERT_TRUE(merged.has_value());
    const GeometricMerge expected = MergeByGeometry(world, placement->extent, 1e-3L);
    for (std::size_t i = 0; i < expected.cells.size(); ++i) {
      if (!expected.is_certain[i]) continue;
      ++certain;
      known += expected.cells[i] != Cell::kUnknown ? 1 : 0;
      ASSERT_EQ(merged->merged.grid.cells[i], expected.cells[i]) << "cell " << i;
    }
  }
  EXPECT_GT(certain, 100'000u);
  EXPECT_GT(known, 10'000u);
}

TEST(CpuMergerTest, NothingMergesToNothing) {
  const Result<MapPlacement> placement = PlaceMaps({}, {}, {});
  ASSERT_TRUE(placement.has_value());
  const Result<MergeResult> merged = CpuMerger().Merge(*placement);
  ASSERT_TRUE(merged.has_value());
  EXPECT_EQ(merged->merged.grid, Grid());
}

TEST(CpuMergerTest, ProvenanceNamesMapAndLayer) {
  TraversabilityMap map = DrawMap({"# "}, 50'000);
  map.layers.push_back(DrawMap({".."}, 50'000).layers[0]);
  const MergeGrid grid;
  const auto local = MakeLocalMap(MapKey(3, 9), 1, map, grid);
  ASSERT_TRUE(local.has_value());
  const Result<MapPlacement> placement = PlaceMaps({{*local, Pose{}}}, {}, grid);
  ASSERT_TRUE(placement.has_value());
  const Result<MergeResult> merged = CpuMerger().Merge(*placement);
  ASSERT_TRUE(merged.has_value());
  EXPECT_EQ(merged->slots, (std::vector<std::uint16_t>{0, 0}));
  EXPECT_EQ(merged->levels, (std::vector<std::uint8_t>{0, 1}));
  EXPECT_EQ(placement->slots[merged->slots[0]].map->key, MapKey(3, 9));
}

TEST(CpuMergerTest, AMergeCanBeStopped) {
  std::mt19937_64 rng(3);
  const World world = MakeRandomWorld(rng);
  const Result<MapPlacement> placement = PlaceMaps(world.maps, world.footprints, world.grid);
  ASSERT_TRUE(placement.has_value());
  const Result<MergeResult> merged = CpuMerger().Merge(*placement, [] { return true; });
  ASSERT_FALSE(merged.has_value());
  EXPECT_EQ(merged.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace moondb
