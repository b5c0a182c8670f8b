#include "apps/moondb_replay/map_frame.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

MergedMap MapWithOneCell(std::int64_t x, std::int64_t y, Cell cell) {
  MergedMap map;
  map.resolution_um = 50000;
  map.origin_cell_x = x - 3;
  map.origin_cell_y = y - 1;
  map.grid = Grid(10, 10);
  map.grid.At(3, 1) = cell;
  return map;
}

TEST(MapFrameTest, HoldsTheKnownCellsOfAllMapsAtOnePlace) {
  const MergedMap a = MapWithOneCell(-20, 5, Cell::kHazard);
  const MergedMap b = MapWithOneCell(4, -7, Cell::kFree);
  const MergedMap* maps[] = {&a, &b};
  const MapFrame frame = FrameOf(maps, 2);
  const MergedMap framed_a = InFrame(a, frame);
  const MergedMap framed_b = InFrame(b, frame);
  EXPECT_EQ(framed_a.origin_cell_x, -22);
  EXPECT_EQ(framed_a.origin_cell_y, -9);
  EXPECT_EQ(framed_a.grid.width, 29);
  EXPECT_EQ(framed_a.grid.height, 17);
  EXPECT_EQ(framed_a.grid.At(2, 14), Cell::kHazard);
  EXPECT_EQ(framed_b.grid.At(26, 2), Cell::kFree);
  EXPECT_EQ(framed_b.grid.At(2, 14), Cell::kUnknown);
}

TEST(MapFrameTest, IsEmptyWhereNothingIsKnown) {
  const MergedMap map = MapWithOneCell(0, 0, Cell::kUnknown);
  const MergedMap* maps[] = {&map};
  EXPECT_TRUE(FrameOf(maps, 2).is_empty());
  EXPECT_TRUE(InFrame(map, FrameOf(maps, 2)).grid.cells.empty());
}

}  // namespace
}  // namespace moondb
