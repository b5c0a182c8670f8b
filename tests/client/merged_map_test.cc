#include "client/merged_map.h"

#include <gtest/gtest.h>
#include <zstd.h>

namespace moondb {
namespace {

std::string ZstdFrame(const std::string& cells) {
  std::string frame(ZSTD_compressBound(cells.size()), '\0');
  frame.resize(ZSTD_compress(frame.data(), frame.size(), cells.data(), cells.size(), 1));
  return frame;
}

proto::MergeReply Reply(std::uint32_t width, std::uint32_t height, const std::string& cells) {
  proto::MergeReply reply;
  reply.set_resolution_um(50000);
  reply.set_origin_cell_x(-7);
  reply.set_origin_cell_y(3);
  reply.set_width_cells(width);
  reply.set_height_cells(height);
  reply.set_zstd_cells(ZstdFrame(cells));
  return reply;
}

proto::MapTilesReply Tile(std::int64_t x, std::int64_t y, const std::string& frame) {
  proto::MapTilesReply reply;
  reply.set_resolution_um(50000);
  reply.set_tile_cells(2);
  reply.add_tiles()->set_x(x);
  reply.mutable_tiles(0)->set_y(y);
  reply.mutable_tiles(0)->set_zstd_cells(frame);
  return reply;
}

TEST(MergedMapTest, DecodesCellsAndPlace) {
  const auto map = DecodeMergedMap(Reply(3, 2, {0, 1, 2, 2, 1, 0}));
  ASSERT_TRUE(map.has_value()) << ToString(map.error());
  EXPECT_EQ(map->resolution_um, 50000u);
  EXPECT_EQ(map->origin_cell_x, -7);
  EXPECT_EQ(map->origin_cell_y, 3);
  EXPECT_EQ(map->grid.width, 3);
  EXPECT_EQ(map->grid.At(2, 0), Cell::kHazard);
  EXPECT_EQ(map->grid.At(2, 1), Cell::kUnknown);
}

TEST(MergedMapTest, AcceptsAnEmptyMap) {
  const auto map = DecodeMergedMap({});
  ASSERT_TRUE(map.has_value());
  EXPECT_TRUE(map->grid.cells.empty());
}

TEST(MergedMapTest, RefusesInconsistentReplies) {
  EXPECT_FALSE(DecodeMergedMap(Reply(3, 3, {0, 1, 2, 2, 1, 0})).has_value());
  EXPECT_FALSE(DecodeMergedMap(Reply(3, 2, {0, 1, 3, 2, 1, 0})).has_value());
  proto::MergeReply cut = Reply(3, 2, {0, 1, 2, 2, 1, 0});
  cut.mutable_zstd_cells()->pop_back();
  EXPECT_FALSE(DecodeMergedMap(cut).has_value());
  proto::MergeReply huge = Reply(3, 2, {0, 1, 2, 2, 1, 0});
  huge.set_width_cells(0xFFFF'FFFF);
  huge.set_height_cells(0xFFFF'FFFF);
  EXPECT_FALSE(DecodeMergedMap(huge).has_value());
}

TEST(MergedMapTest, DecodesTilesAndTheirPlaces) {
  const auto tiles = DecodeMapTiles(Tile(-2, 5, ZstdFrame({0, 1, 2, 1})));
  ASSERT_TRUE(tiles) << ToString(tiles.error());
  ASSERT_EQ(tiles->size(), 1u);
  EXPECT_EQ(tiles->front().map.origin_cell_x, -4);
  EXPECT_EQ(tiles->front().map.origin_cell_y, 10);
  EXPECT_EQ(tiles->front().map.grid.At(0, 1), Cell::kHazard);
  const auto forgotten = DecodeMapTiles(Tile(0, 0, ""));
  ASSERT_TRUE(forgotten);
  EXPECT_EQ(forgotten->front().map.grid, Grid(2, 2, Cell::kUnknown));
}

TEST(MergedMapTest, RefusesTilesThatDoNotFit) {
  EXPECT_FALSE(DecodeMapTiles(Tile(0, 0, ZstdFrame({0, 1, 2}))));
  EXPECT_FALSE(DecodeMapTiles(Tile(0, 0, ZstdFrame({0, 1, 2, 3}))));
  EXPECT_FALSE(DecodeMapTiles(Tile(INT64_MIN, 0, ZstdFrame({0, 1, 2, 1}))));
  EXPECT_FALSE(DecodeMapTiles(Tile(0, INT64_MAX, ZstdFrame({0, 1, 2, 1}))));
  proto::MapTilesReply huge = Tile(0, 0, "");
  huge.set_tile_cells(5000);
  EXPECT_FALSE(DecodeMapTiles(huge));
  huge.set_tile_cells(0);
  EXPECT_FALSE(DecodeMapTiles(huge));
}

}  // namespace
}  // namespace moondb
