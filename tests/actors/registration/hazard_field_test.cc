#include "actors/registration/hazard_field.h"

#include <gtest/gtest.h>

#include "tests/actors/registration/hazard_world.h"

namespace moondb {
namespace {

MapLayer LayerOf(int side_cells, std::uint32_t resolution_um, Cell fill) {
  MapLayer layer;
  layer.grid = Grid(side_cells, side_cells, fill);
  layer.resolution_um = resolution_um;
  return layer;
}

TraversabilityMap MapOf(std::vector<MapLayer> layers) {
  TraversabilityMap map;
  map.layers = std::move(layers);
  return map;
}

std::uint32_t LikelihoodAt(const HazardField& field, int level, FieldCell cell) {
  return field.SumOfLikelihoods(level, std::vector<FieldCell>{cell}, {cell, cell}, 0, 0);
}

TEST(HazardFieldTest, HazardCellsBecomePointsAtTheirCentres) {
  MapLayer layer = LayerOf(4, 50'000, Cell::kFree);
  layer.grid.At(3, 0) = Cell::kHazard;
  const HazardField field(MapOf({layer}), {});
  ASSERT_EQ(field.points_m().size(), 1u);
  EXPECT_NEAR(field.points_m()[0].x(), 0.075, 1e-12);
  EXPECT_NEAR(field.points_m()[0].y(), -0.075, 1e-12);
}

TEST(HazardFieldTest, AFinerLayerReplacesACoarserOneWhereItKnowsTheCell) {
  MapLayer fine = LayerOf(8, 50'000, Cell::kUnknown);
  const MapLayer coarse = LayerOf(4, 100'000, Cell::kHazard);
  EXPECT_EQ(HazardField(MapOf({fine, coarse}), {}).points_m().size(), 16u);
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 4; ++column) fine.grid.At(column, row) = Cell::kFree;
  }
  EXPECT_EQ(HazardField(MapOf({fine, coarse}), {}).points_m().size(), 8u);
}

TEST(HazardFieldTest, LayersCoarserThan20CentimetresAreNotUsed) {
  EXPECT_EQ(HazardField(MapOf({LayerOf(4, 200'000, Cell::kHazard)}), {}).points_m().size(), 16u);
  EXPECT_EQ(HazardField(MapOf({LayerOf(4, 250'000, Cell::kHazard)}), {}).points_m().size(), 0u);
}

TEST(HazardFieldTest, ALayerFinerThanTheFieldGivesOnePointPerFieldCell) {
  EXPECT_EQ(HazardField(MapOf({LayerOf(40, 10'000, Cell::kHazard)}), {}).points_m().size(), 64u);
}

TEST(HazardFieldTest, MapsWithoutCellsHaveNoPoints) {
  for (const TraversabilityMap& map :
       {MapOf({}), MapOf({LayerOf(1, 50'000, Cell::kUnknown)}), MapOf({LayerOf(100, 50'000, Cell::kFree)})}) {
    const HazardField field(map, {});
    EXPECT_TRUE(field.points_m().empty());
    EXPECT_FALSE(field.DistanceAt({1000, 0}).is_known);
    EXPECT_EQ(field.DistanceAt({1000, 0}).distance_m, HazardField::kDistanceMax_m);
  }
}

TEST(HazardFieldTest, AHugeMapIsCutToTheInner40Metres) {
  const HazardField field(MapOf({LayerOf(2000, 50'000, Cell::kHazard)}), {});
  EXPECT_EQ(field.side_cells(), 800);
  EXPECT_EQ(field.points_m().size(), HazardField::kPointsMax);
  EXPECT_LT(field.bytes(), 8u << 20);
}

TEST(HazardFieldTest, DistancesAreThoseToTheNearestHazardUpTo60Centimetres) {
  HazardWorld world;
  world.rocks = {{{0.5, 0.5}, 0.2}, {{-1, 0.25}, 0.1}};
  const HazardField field(world.MapAt({}), {});
  for (double y = -1.5; y <= 1.5; y += 0.13) {
    for (double x = -1.5; x <= 1.5; x += 0.11) {
      double expected = HazardField::kDistanceMax_m;
      for (const Eigen::Vector2d& point_m : field.points_m()) {
        expected = std::min(expected, (point_m - Eigen::Vector2d(x, y)).norm());
      }
      EXPECT_NEAR(field.DistanceAt({x, y}).distance_m, expected, 0.03) << x << ' ' << y;
    }
  }
}

TEST(HazardFieldTest, TheGradientIsTheSlopeOfTheDistance) {
  HazardWorld world;
  world.rocks = {{{0, 0}, 0.2}};
  const HazardField field(world.MapAt({}), {});
  const Eigen::Vector2d at(0.31, 0.22);
  constexpr double kStep = 1e-5;
  const double along_x =
      (field.DistanceAt(at + Eigen::Vector2d(kStep, 0)).distance_m - field.DistanceAt(at).distance_m) / kStep;
  const double along_y =
      (field.DistanceAt(at + Eigen::Vector2d(0, kStep)).distance_m - field.DistanceAt(at).distance_m) / kStep;
  EXPECT_NEAR(field.DistanceAt(at).gradient.x(), along_x, 1e-3);
  EXPECT_NEAR(field.DistanceAt(at).gradient.y(), along_y, 1e-3);
  EXPECT_GT(along_x, 0.5);
}

TEST(HazardFieldTest, MaskedDiscsAreUnknown) {
  HazardWorld world;
  world.rocks = {{{0, 0}, 0.3}, {{1, 1}, 0.2}};
  const std::vector<MaskedDisc> masked = {{{0, 0}, 0.5}};
  const HazardField field(world.MapAt({}), masked);
  for (const Eigen::Vector2d& point_m : field.points_m()) EXPECT_GT(point_m.norm(), 0.5);
  EXPECT_FALSE(field.points_m().empty());
  EXPECT_FALSE(field.DistanceAt({0, 0}).is_known);
  EXPECT_TRUE(field.DistanceAt({0, 0.7}).is_known);
}

// The bound of a square must never be below a value in it, or the search would miss the best offset.
TEST(HazardFieldTest, LevelsHoldTheMaximaOfTheirSquares) {
  const HazardField field(HazardWorld::OfRocks(1, 30).MapAt({}), {});
  for (int level = 1; level < HazardField::kLevels; ++level) {
    const int side = 1 << level;
    for (int row = -20; row < field.side_cells() + 20; row += 7) {
      for (int column = -20; column < field.side_cells() + 20; column += 5) {
        std::uint32_t most = 0;
        for (int y = 0; y < side; ++y) {
          for (int x = 0; x < side; ++x) most = std::max(most, LikelihoodAt(field, 0, {column + x, row + y}));
        }
        ASSERT_EQ(LikelihoodAt(field, level, {column, row}), most) << level << ' ' << column << ' ' << row;
      }
    }
  }
}

TEST(HazardFieldTest, SumsAreTheSameInsideTheFieldAndAcrossItsEdge) {
  const HazardField field(HazardWorld::OfRocks(2, 30).MapAt({}), {});
  const std::vector<FieldCell> cells = {{3, 4}, {50, 60}, {-4, 10}, {199, 199}};
  const FieldBox box = {{-4, 4}, {199, 199}};
  for (const int column : {-300, -30, -5, 0, 5, 30, 300}) {
    std::uint32_t expected = 0;
    for (const FieldCell& cell : cells) expected += LikelihoodAt(field, 2, {cell.column + column, cell.row + 7});
    EXPECT_EQ(field.SumOfLikelihoods(2, cells, box, column, 7), expected) << column;
  }
}

}  // namespace
}  // namespace moondb
