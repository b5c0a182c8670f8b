#include "actors/merge/placement.h"

#include <gtest/gtest.h>

#include <limits>

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

TEST(PlacementTest, BlocksOfOneLayerMeetWithoutASeam) {
  for (const int width : {511, 512, 513, 1023, 1024, 1500}) {
    TraversabilityMap map;
    map.layers.push_back({Grid(width, 3, Cell::kHazard), 50'000, 0, 0});
    MergeOptions options;
    options.backend = MergeBackend::kCpu;
    const Pose pose = Pose::FromPlanar(0.3, 0.1, 0.1);
    const Result<MergedMap> merged = MergeMaps(std::vector<MapAtPose>{{MapKey(1, 1), 1, pose, map}}, {}, options);
    ASSERT_TRUE(merged.has_value());
    // The strip is three cells thick and slightly turned, so every column of the grid meets it.
    for (std::int32_t x = 3; x < merged->grid.width - 3; ++x) {
      bool is_hit = false;
      for (std::int32_t y = 0; y < merged->grid.height; ++y) is_hit |= merged->grid.At(x, y) == Cell::kHazard;
      ASSERT_TRUE(is_hit) << "column " << x << " of " << width;
    }
  }
}

TEST(PlacementTest, TheExtentCountsUnknownCells) {
  TraversabilityMap map;
  map.layers.push_back({Grid(1000, 10), 50'000, 0, 0});
  map.layers[0].grid.At(999, 0) = Cell::kFree;
  const auto local = *MakeLocalMap(MapKey(1, 1), 1, map, {});
  const auto placed = PlaceMap({local, Pose{}}, {});
  ASSERT_TRUE(placed.has_value());
  EXPECT_EQ((*placed)->extent.width(), 1000);
  EXPECT_EQ((*placed)->blocks.size(), 1u);
}

TEST(PlacementTest, RefusesInvalidPoses) {
  const auto map = MakeFilledMap(4, 4);
  for (const double x_m : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e14}) {
    Pose pose;
    pose.position_m.x() = x_m;
    const auto placed = PlaceMap({map, pose}, {});
    ASSERT_FALSE(placed.has_value()) << x_m;
    EXPECT_EQ(placed.error().field, "map_from_node");
    EXPECT_EQ(PlaceFootprint({{1, 1}, pose}, {}).error().field, "map_from_node");
  }
  Pose turned;
  turned.orientation.w() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(PlaceMap({map, turned}, {}).has_value());
  EXPECT_TRUE(PlaceMap({map, Pose::FromPlanar(1e9, -1e9, 1)}, {}).has_value()) << "as wide as records admit";
}

TEST(PlacementTest, RefusesAMapThatIsTooLarge) {
  const auto map = MakeFilledMap(17, 17, 100'000'000);
  const auto placed = PlaceMap({map, Pose{}}, {});
  ASSERT_FALSE(placed.has_value());
  EXPECT_EQ(placed.error().field, "layers");
  EXPECT_NE(placed.error().text.find("16384"), std::string::npos);
  EXPECT_TRUE(PlaceMap({MakeFilledMap(10'000, 10'000), Pose{}}, {}).has_value());
}

TEST(PlacementTest, AFootprintMayBeEmpty) {
  const auto placed = PlaceFootprint({{1, 1}, Pose{}}, {.footprint_length_m = 0, .footprint_width_m = 0});
  ASSERT_TRUE(placed.has_value());
  EXPECT_TRUE((*placed)->blocks.empty());
  EXPECT_TRUE((*placed)->extent.is_empty());
  for (const double side_m : {0.0, 0.5}) {  // The footprint is a point (0.0) or a line (0.5), which frees no cell.
    const auto line = PlaceFootprint({{1, 1}, Pose::FromPlanar(0.025, 0.025, 0.785)},
                                     {.footprint_length_m = 0, .footprint_width_m = side_m});
    ASSERT_TRUE(line.has_value());
    EXPECT_TRUE((*line)->blocks.empty());
  }
}

}  // namespace
}  // namespace moondb
