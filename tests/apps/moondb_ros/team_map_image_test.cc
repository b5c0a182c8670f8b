#include "apps/moondb_ros/team_map_image.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

// A tile of 256 x 256 unknown cells with one cell set.
MergedTile TileAt(std::int64_t x, std::int64_t y, std::int32_t column, std::int32_t row, Cell cell) {
  MergedTile tile{x, y, {}};
  tile.map.resolution_um = 50'000;
  tile.map.grid = Grid(256, 256);
  tile.map.grid.At(column, row) = cell;
  return tile;
}

TEST(TeamMapImageTest, CropsToKnownCellsInBlocks) {
  TeamMapImage image;
  EXPECT_FALSE(image.ToGrid({0, 0}));
  EXPECT_TRUE(image.Add({true, {TileAt(0, 0, 70, 10, Cell::kHazard), TileAt(-1, 0, 250, 130, Cell::kFree)}}));
  const auto picture = image.ToGrid({0, 0});
  ASSERT_TRUE(picture);
  const RosGrid& grid = picture->grid;
  EXPECT_FALSE(picture->is_partial);
  EXPECT_EQ(grid.width, 192u);   // Cells -64 to 127.
  EXPECT_EQ(grid.height, 192u);  // Cells 0 to 191.
  EXPECT_NEAR(grid.frame_from_origin.position_m.x(), -3.2, 1e-9);
  EXPECT_NEAR(grid.frame_from_origin.position_m.y(), 0, 1e-9);
  EXPECT_EQ(grid.values[10 * 192 + 64 + 70], 100);
  EXPECT_EQ(grid.values[130 * 192 + 64 - 6], 0);
  EXPECT_EQ(std::count(grid.values.begin(), grid.values.end(), -1), 192 * 192 - 2);
}

TEST(TeamMapImageTest, SaysWhetherACellChanged) {
  TeamMapImage image;
  EXPECT_TRUE(image.Add({true, {TileAt(0, 0, 1, 1, Cell::kFree)}}));
  EXPECT_FALSE(image.Add({true, {TileAt(0, 0, 1, 1, Cell::kFree)}}));
  EXPECT_FALSE(image.Add({false, {TileAt(0, 0, 1, 1, Cell::kFree)}}));
  EXPECT_TRUE(image.Add({false, {TileAt(0, 0, 1, 1, Cell::kHazard)}}));
  EXPECT_FALSE(image.Add({false, {TileAt(5, 0, 1, 1, Cell::kUnknown)}}));
  EXPECT_TRUE(image.Add({true, {}}));
  EXPECT_FALSE(image.ToGrid({0, 0}));
  EXPECT_FALSE(image.Add({true, {}}));
}

TEST(TeamMapImageTest, ForgetsATileWithoutKnownCells) {
  TeamMapImage image;
  EXPECT_TRUE(image.Add({true, {TileAt(0, 0, 1, 1, Cell::kFree), TileAt(3, 3, 1, 1, Cell::kFree)}}));
  EXPECT_TRUE(image.Add({false, {TileAt(3, 3, 1, 1, Cell::kUnknown)}}));
  EXPECT_EQ(image.ToGrid({0, 0})->grid.width, 64u);
}

TEST(TeamMapImageTest, CutsAHugeMapAroundTheRobot) {
  TeamMapImage image;
  EXPECT_TRUE(image.Add({true, {TileAt(0, 0, 0, 0, Cell::kFree), TileAt(40, 0, 0, 0, Cell::kHazard)}}));
  const auto far = image.ToGrid({40 * 256 * 0.05, 0});
  ASSERT_TRUE(far);
  EXPECT_TRUE(far->is_partial);
  EXPECT_EQ(far->grid.width, 4096u);
  EXPECT_EQ(std::count(far->grid.values.begin(), far->grid.values.end(), 100), 1);
  EXPECT_EQ(std::count(far->grid.values.begin(), far->grid.values.end(), 0), 0);
  const auto near = image.ToGrid({0, 0});
  EXPECT_EQ(std::count(near->grid.values.begin(), near->grid.values.end(), 0), 1);
  EXPECT_EQ(std::count(near->grid.values.begin(), near->grid.values.end(), 100), 0);
}

}  // namespace
}  // namespace moondb
