#include "actors/sharing/coding/placement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "drawn_maps.h"

namespace moondb {
namespace {

CodedLayers ToCoded(const Layers& layers) {
  CodedLayers coded;
  for (const MapLayer& layer : layers) {
    CodedLayer& added = coded.emplace_back();
    added.cells = CellPlane(layer.grid.width, layer.grid.height);
    added.resolution_um = layer.resolution_um;
    for (int row = 0; row < layer.grid.height; ++row) {
      for (int column = 0; column < layer.grid.width; ++column) {
        *added.cells.At(column, row) = static_cast<std::uint8_t>(layer.grid.At(column, row));
      }
    }
    // The map has no previous map, so `memory` contains only the map's own cells.
    added.memory = added.cells;
  }
  return coded;
}

TEST(PlacementTest, RotatesByTheGivenAngle) {
  for (std::int32_t yaw = 0; yaw < kTurn; ++yaw) {
    const double angle = 2 * std::numbers::pi * yaw / kTurn;
    const Rotation rotation = RotationOf(yaw);
    ASSERT_NEAR(static_cast<double>(rotation.cosine), 16384 * std::cos(angle), 0.6) << yaw;
    ASSERT_NEAR(static_cast<double>(rotation.sine), 16384 * std::sin(angle), 0.6) << yaw;
  }
}

TEST(PlacementTest, DoesNotMoveAMapIfTheRobotDidNotMove) {
  const CodedLayers map = ToCoded(RoomMap(4, 0, 0, 0.3));
  for (const CodedLayer& layer : map) {
    const CellPlane placed = Place(map, layer, map.front().resolution_um, {});
    for (int row = 0; row < placed.height(); ++row) {
      for (int column = 0; column < placed.width(); ++column) {
        ASSERT_EQ(*placed.At(column, row), *layer.cells.At(column, row));
      }
    }
  }
}

TEST(PlacementTest, ShiftsByHalfCellsAndTurns) {
  CodedLayers earlier = ToCoded(DrawLayers(1, 9, 9, [](int, int, int) { return Cell::kFree; }));
  // Marks the cell that is 3 cells ahead of the centre.
  *earlier[0].memory.At(7, 4) = 2;
  CodedLayers later = ToCoded(DrawLayers(1, 9, 9, [](int, int, int) { return Cell::kUnknown; }));
  const std::uint32_t unit = later[0].resolution_um;
  // The robot moves ahead by two half cells. The marked cell is then one cell nearer.
  EXPECT_EQ(*Place(earlier, later[0], unit, {2, 0, 0}).At(6, 4), 2);
  // The robot turns left by 90 degrees. The marked cell is then on its right.
  EXPECT_EQ(*Place(earlier, later[0], unit, {0, 0, kTurn / 4}).At(4, 1), 2);
  EXPECT_EQ(*Place(earlier, later[0], unit, {2, 0, 0}).At(8, 4), kNoMemory);
  EXPECT_EQ(*Place(earlier, later[0], unit, {0, 0, kTurn / 2}).At(1, 4), 2);
}

TEST(PlacementTest, UsesACoarserLayerBeyondTheFinerOne) {
  CodedLayers earlier = ToCoded(DrawLayers(2, 8, 8, [](int layer, int, int) { return static_cast<Cell>(layer + 1); }));
  const CodedLayers later = earlier;
  // The robot moves ahead by 3 cells of the finer layer.
  const CellPlane placed = Place(earlier, later[0], later[0].resolution_um, {6, 0, 0});
  EXPECT_EQ(*placed.At(4, 4), 1);
  EXPECT_EQ(*placed.At(5, 4), 2);
}

TEST(PlacementTest, FindsHowTheRobotMoved) {
  for (const auto& [x_m, y_m, yaw_rad] :
       {std::tuple{0.5, -0.3, 0.6}, {-0.8, 0.2, -2.0}, {0.0, 0.0, 3.0}, {1.0, 1.0, 0.0}}) {
    const std::optional<MapPlacement> found =
        FindPlacement(ToCoded(RoomMap(6, 0, 0, 0, 4, 100)), ToCoded(RoomMap(6, x_m, y_m, yaw_rad, 4, 100)));
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->x * 0.025, x_m, 0.11);
    EXPECT_NEAR(found->y * 0.025, y_m, 0.11);
    EXPECT_NEAR(std::remainder(found->yaw - yaw_rad / (2 * std::numbers::pi) * kTurn, kTurn), 0, 8);
  }
}

TEST(PlacementTest, FindsNoPlacementWithoutHazardsInBothMaps) {
  const CodedLayers room = ToCoded(RoomMap(6, 0, 0, 0));
  const CodedLayers blank = ToCoded(DrawLayers(4, 64, 64, [](int, int, int) { return Cell::kFree; }));
  EXPECT_FALSE(FindPlacement(room, blank));
  EXPECT_FALSE(FindPlacement(blank, room));
  EXPECT_FALSE(FindPlacement({}, room));
}

}  // namespace
}  // namespace moondb
