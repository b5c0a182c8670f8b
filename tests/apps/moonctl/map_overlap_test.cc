#include "apps/moonctl/map_overlap.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <numbers>

#include "apps/moonctl/submap_overlap.h"
#include "model/png.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::EndsWith;

enum : std::uint8_t { kNothing, kFreeOfEither, kOfFirst, kOfSecond, kOfBoth };

// A free layer about the origin, with hazards in the cells whose columns and rows are given.
MapLayer LayerWith(std::int32_t side, std::uint32_t resolution_um,
                   const std::vector<std::pair<std::int32_t, std::int32_t>>& hazards) {
  MapLayer layer{Grid(side, side, Cell::kFree), resolution_um, 0, 0};
  for (const auto& [column, row] : hazards) layer.grid.At(column, row) = Cell::kHazard;
  return layer;
}

OverlaidMaps MapsOf(std::vector<MapLayer> first, std::vector<MapLayer> second) {
  return {{{1, 5}, Pose(), std::move(first)}, {{2, 7}, Pose(), std::move(second)}, "rover1:5", "rover2:7"};
}

// Returns the value of the raster at a place in the frame of the first map.
std::uint8_t ValueAt(const Raster& raster, double x_m, double y_m) {
  const auto column = static_cast<std::int64_t>(std::floor(x_m / 0.05)) - raster.origin_cell_x;
  const auto row = static_cast<std::int64_t>(std::floor(y_m / 0.05)) - raster.origin_cell_y;
  EXPECT_TRUE(column >= 0 && row >= 0 && column < raster.width && row < raster.height);
  return raster.cells.at(static_cast<std::size_t>(row * raster.width + column));
}

TEST(MapOverlapTest, DrawsBothMapsInTheFrameOfTheFirst) {
  // Each map has a hazard 0.5 m ahead. The second map lies 1 m to the left and is turned to the left.
  const auto maps = MapsOf({LayerWith(40, 50'000, {{30, 20}})}, {LayerWith(40, 50'000, {{30, 20}})});
  const Raster raster = OverlapRaster(maps, {0, 1, std::numbers::pi / 2});
  EXPECT_EQ(ValueAt(raster, 0.525, 0.025), kOfFirst);
  EXPECT_EQ(ValueAt(raster, -0.025, 1.525), kOfSecond);
  EXPECT_EQ(ValueAt(raster, 0.525, 0.525), kFreeOfEither);
  EXPECT_EQ(std::ranges::count(raster.cells, kOfBoth), 0);
  EXPECT_NEAR(raster.width, 40 + 20, 2);
  EXPECT_NEAR(raster.height, 60 + 20, 2) << "both maps are inside, with a margin of 0.5 m";
}

TEST(MapOverlapTest, DrawsHazardsOfBothMapsAsOne) {
  const auto maps = MapsOf({LayerWith(40, 50'000, {{30, 20}})}, {LayerWith(40, 50'000, {{10, 20}})});
  const Raster raster = OverlapRaster(maps, {1, 0, 0});
  EXPECT_EQ(ValueAt(raster, 0.525, 0.025), kOfBoth);
  EXPECT_EQ(std::ranges::count(raster.cells, kOfBoth), 1);
  EXPECT_EQ(raster.classes.at(kOfFirst).name, "hazard of rover1:5");
  EXPECT_EQ(raster.classes.at(kOfBoth).color, (Color{0, 0, 0}));
}

TEST(MapOverlapTest, DrawsTheFinestLayerThatKnowsAPlace) {
  const MapLayer coarse{Grid(4, 4, Cell::kHazard), 1'000'000, 0, 0};
  const auto maps = MapsOf({LayerWith(20, 50'000, {}), coarse}, {LayerWith(2, 50'000, {})});
  const Raster raster = OverlapRaster(maps, {});
  EXPECT_EQ(ValueAt(raster, 0.1, 0.1), kFreeOfEither);
  EXPECT_EQ(ValueAt(raster, 1.1, 0.1), kOfFirst);
}

TEST(MapOverlapTest, OmitsTheUnknownAreaAroundTheMaps) {
  MapLayer layer{Grid(400, 400), 50'000, 0, 0};
  const auto empty = MapsOf({layer}, {layer});
  EXPECT_EQ(OverlapRaster(empty, {}).width, 20);
  layer.grid.At(300, 200) = Cell::kHazard;
  const Raster raster = OverlapRaster(MapsOf({layer}, {layer}), {});
  EXPECT_NEAR(raster.width, 21, 2);
  EXPECT_EQ(ValueAt(raster, 5.025, 0.025), kOfBoth);
}

TEST(MapOverlapTest, DrawsNothingFarFromTheFirstMap) {
  const auto maps = MapsOf({LayerWith(40, 50'000, {})}, {LayerWith(40, 50'000, {{1, 1}})});
  const Raster raster = OverlapRaster(maps, {5000, 0, 0});
  EXPECT_NEAR(raster.width, 630, 2) << "1.5 m behind the middle of the first map, 30 m ahead";
  EXPECT_EQ(std::ranges::count(raster.cells, kOfSecond), 0);
}

TEST(MapOverlapTest, CountsHazardsOfTheFirstMapInTheKnownAreaOfTheSecond) {
  // The second map ends at x = 0.5 m. It has a hazard 10 cm from the first of the two common hazards.
  const auto maps = MapsOf({LayerWith(60, 50'000, {{30, 30}, {30, 15}, {55, 30}})},
                           {LayerWith(20, 50'000, {{12, 10}}), LayerWith(40, 50'000, {})});
  const OverlapShare share = MeasureOverlap(maps, {});
  EXPECT_EQ(share.common_count, 2u);
  EXPECT_EQ(share.matched_count, 1u);
  EXPECT_EQ(MeasureOverlap(maps, {0.1, 0, 0}).matched_count, 0u) << "20 cm away";
  EXPECT_EQ(MeasureOverlap(maps, {50, 0, 0}).ratio(), std::nullopt);
}

TEST(MapOverlapTest, PlacesMapsByThePosesOfTheirNodes) {
  auto maps = MapsOf({}, {});
  maps.first.node_from_map = Pose::FromPlanar(0, 0, std::numbers::pi / 2);
  maps.second.node_from_map = Pose::FromPlanar(1, 0, 0);
  const PlanarOffset offset =
      OffsetOf(maps, {"odometry", Pose::FromPlanar(10, 0, 0), Pose::FromPlanar(10, 2, std::numbers::pi / 2)});
  EXPECT_NEAR(offset.x_m, 3, 1e-9);
  EXPECT_NEAR(offset.y_m, 0, 1e-9);
  EXPECT_NEAR(offset.yaw_rad, 0, 1e-9);
}

TEST(MapOverlapTest, WritesAPanelPerPlacementWithTheShareInItsTitle) {
  const auto maps = MapsOf({LayerWith(40, 50'000, {{30, 20}})}, {LayerWith(40, 50'000, {{30, 20}})});
  const Picture picture = OverlapPicture(
      maps, {{"odometry", Pose(), Pose::FromPlanar(100, 0, 0)}, {"optimized", Pose(), Pose()}}, std::numbers::pi / 2);
  std::vector<std::string> titles;
  for (const Panel& panel : picture.panels) titles.push_back(panel.title);
  EXPECT_THAT(titles, ElementsAre("odometry: no common hazards", "optimized: 100 % of 1 hazards"));
  const TemporaryFolder folder;
  ASSERT_TRUE(WritePicture(picture, folder.path() / "x.png"));
  EXPECT_GT(ReadPng(folder.path() / "x.png")->width, 1280);
  EXPECT_THAT(WritePicture(picture, folder.path() / "none" / "x.png").error().field, EndsWith("none/x.png"));
}

TEST(SubmapOverlapTest, ASubmapBecomesAMapOfItsCells) {
  Submap::Source source;
  source.map.layers = {LayerWith(20, 100'000, {{15, 10}})};
  source.submap_from_local = {1, 0, 0};
  const Submap submap(std::span<const Submap::Source>(&source, 1));
  const TraversabilityMap cells = CellsOf(submap);
  const MapLayer& layer = cells.layers.at(0);
  const auto cell_at = [&layer](double x_m, double y_m) {
    return layer.grid.At(layer.grid.width / 2 + static_cast<std::int32_t>(std::floor(x_m / 0.1)),
                         layer.grid.height / 2 + static_cast<std::int32_t>(std::floor(y_m / 0.1)));
  };
  EXPECT_EQ(cell_at(1.55, 0.05), Cell::kHazard);
  EXPECT_EQ(cell_at(1.05, 0.05), Cell::kFree);
  EXPECT_EQ(cell_at(3.05, 0.05), Cell::kUnknown);
}

}  // namespace
}  // namespace moondb
