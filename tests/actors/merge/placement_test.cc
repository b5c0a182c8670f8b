#include "actors/merge/placement.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "actors/merge/merge_maps.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

std::shared_ptr<const LocalMap> MakeFilledMap(int width, int height, std::uint32_t resolution_um = 50'000) {
  TraversabilityMap map;
  map.node = {1, 1};
  map.layers.push_back({Grid(width, height, Cell::kHazard), resolution_um, 0, 0});
  return *MakeLocalMap(MapKey(1, 1), 1, map, {});
}

TEST(PlacementTest, LayersLargerThanABlockAreSplitWithoutSeams) {
  for (const int width : {511, 512, 513, 1023, 1024, 1500}) {
    const auto map = MakeFilledMap(width, 3);
    std::int32_t covered = 0;
    for (const LayerBlock& block : map->blocks) {
      EXPECT_LE(block.width, kBlockSideCellsMax);
      EXPECT_EQ(block.column, std::max(0, covered - 1)) << "one column is shared";
      covered = block.column + block.width;
    }
    EXPECT_EQ(covered, width);
    MergeOptions options;
    options.backend = MergeBackend::kCpu;
    const Pose pose = Pose::FromPlanar(0.3, 0.1, 0.1);
    const Result<MergedMap> merged = MergeMaps(std::vector<MapAtPose>{{map->key, 1, pose, map->map}}, {}, options);
    ASSERT_TRUE(merged.has_value());
    // Three cells thick and turned a little: every column of the grid meets it.
    for (std::int32_t x = 3; x < merged->grid.width - 3; ++x) {
      bool is_hit = false;
      for (std::int32_t y = 0; y < merged->grid.height; ++y) is_hit |= merged->grid.At(x, y) == Cell::kHazard;
      ASSERT_TRUE(is_hit) << "column " << x << " of " << width;
    }
  }
}

TEST(PlacementTest, BlocksWithoutAKnownCellAreNotAsked) {
  TraversabilityMap map;
  map.layers.push_back({Grid(1000, 10), 50'000, 0, 0});
  map.layers[0].grid.At(999, 0) = Cell::kFree;
  const auto local = *MakeLocalMap(MapKey(1, 1), 1, map, {});
  EXPECT_EQ(local->bounds.size(), 2u);
  ASSERT_EQ(local->blocks.size(), 1u);
  EXPECT_EQ(local->blocks[0].column, 511);
  const Result<MapPlacement> placement = PlaceMaps({{local, Pose{}}}, {}, {});
  ASSERT_TRUE(placement.has_value());
  EXPECT_EQ(placement->extent.width(), 1000) << "the extent counts unknown cells";
}

TEST(PlacementTest, RefusesCellsTooFineForTheGrid) {
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

TEST(PlacementTest, RefusesAnExtentBeyondTheLimit) {
  const auto map = MakeFilledMap(4, 4);
  auto other = std::make_shared<LocalMap>(*map);
  other->key = MapKey(2, 1);
  const std::vector<PlacedMap> maps = {{map, Pose{}}, {other, Pose::FromPlanar(1e6, 0, 0)}};
  const Result<MapPlacement> placement = PlaceMaps(maps, {}, {});
  ASSERT_FALSE(placement.has_value());
  EXPECT_EQ(placement.error().code, ErrorCode::kFull);
  EXPECT_NE(placement.error().text.find("16384"), std::string::npos);
}

TEST(PlacementTest, RefusesMoreMapsThanSlots) {
  const auto map = MakeFilledMap(1, 1);
  std::vector<PlacedMap> maps;
  for (std::size_t i = 0; i < kPlacedMapsMax + 1; ++i) {
    auto other = std::make_shared<LocalMap>(*map);
    other->key = MapKey(1, i + 1);
    maps.push_back({std::move(other), Pose{}});
  }
  const Result<MapPlacement> placement = PlaceMaps(maps, {}, {});
  ASSERT_FALSE(placement.has_value());
  EXPECT_EQ(placement.error().code, ErrorCode::kFull);
  maps.pop_back();
  EXPECT_TRUE(PlaceMaps(maps, {}, {}).has_value());
}

TEST(PlacementTest, RefusesAGridThatDoesNotFitTheIntegers) {
  EXPECT_EQ(CheckGrid({.resolution_um = 999}).error().field, "map.resolution_m");
  EXPECT_EQ(CheckGrid({.resolution_um = 1000, .footprint_length_m = 0.513}).error().field, "map.footprint_m");
  EXPECT_EQ(CheckGrid({.footprint_width_m = -1}).error().field, "map.footprint_m");
  EXPECT_TRUE(CheckGrid({}).has_value());
}

}  // namespace
}  // namespace moondb
