#include "apps/moondb_view/board.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::Not;

const std::string kCells(16, '\1');

TEST(BoardTest, ListsWhatChangedAfterAVersion) {
  Board board("run");
  board.Set("team", "{}");
  const std::uint64_t before = board.version();
  board.Set("poses", "{}");
  EXPECT_THAT(board.ChangesJson(0), HasSubstr(R"("resources":{"poses":2,"team":1})"));
  EXPECT_THAT(board.ChangesJson(before), HasSubstr(R"("resources":{"poses":2})"));
  EXPECT_THAT(board.ChangesJson(before), HasSubstr(R"("instance":"run","tiles":[],"is_more":false,"version":2)"));
  EXPECT_THAT(board.ChangesJson(before), HasSubstr(R"("map":null)"));
}

TEST(BoardTest, EqualContentIsNoChange) {
  Board board("run");
  board.Set("team", "{}");
  board.Set("team", "{}");
  EXPECT_EQ(board.version(), 1u);
  board.Set("team", "[]");
  EXPECT_EQ(Inflate(*board.Find("team")).value(), "[]");
  EXPECT_EQ(board.Find("poses"), nullptr);
}

TEST(BoardTest, ListsEachTileOnceWithItsNewestVersion) {
  Board board("run");
  board.BeginMap({50'000, 4, ""});
  board.SetTile(-1, 2, kCells);
  board.SetTile(0, 0, kCells);
  board.SetTile(-1, 2, std::string(16, '\2'));
  EXPECT_THAT(board.ChangesJson(0), HasSubstr(R"("tiles":[[0,0,3],[-1,2,4]])"));
  EXPECT_THAT(board.ChangesJson(3), HasSubstr(R"("tiles":[[-1,2,4]])"));
  const std::string place("\xff\xff\xff\xff\2\0\0\0", 8);
  EXPECT_EQ(board.FindTiles(1, {{5, 5}, {-1, 2}}), place + std::string(16, '\2'));
}

TEST(BoardTest, ListsManyTilesInParts) {
  Board board("run");
  board.BeginMap({50'000, 4, ""});
  for (int x = 0; x < 300; ++x) board.SetTile(x, 0, kCells);
  board.Set("team", "{}");
  const std::string first = board.ChangesJson(0);
  EXPECT_THAT(first, HasSubstr(R"([255,0,257]],"is_more":true,"version":257)"));
  const std::string second = board.ChangesJson(257);
  EXPECT_THAT(second, HasSubstr(R"("tiles":[[256,0,258])"));
  EXPECT_THAT(second, HasSubstr(R"("is_more":false,"version":302)"));
}

TEST(BoardTest, ANewMapForgetsItsTiles) {
  Board board("run");
  board.BeginMap({50'000, 4, ""});
  board.SetTile(1, 1, kCells);
  board.BeginMap({25'000, 4, "rover2"});
  EXPECT_EQ(board.FindTiles(3, {{1, 1}}), "");
  EXPECT_THAT(board.ChangesJson(0), HasSubstr(R"("tiles":[])"));
  EXPECT_THAT(board.ChangesJson(0),
              HasSubstr(R"("map":{"id":3,"resolution_um":25000,"tile_cells":4,"frame_of":"rover2"})"));
  board.SetTile(1, 1, kCells);
  EXPECT_NE(board.FindTiles(3, {{1, 1}}), "");
  EXPECT_EQ(board.FindTiles(1, {{1, 1}}), "") << "cells of the new map for a viewer of the old one";
}

TEST(BoardTest, TilesBeyondTheLimitAreIgnored) {
  Board board("run");
  board.BeginMap({50'000, 1, ""});
  for (std::size_t x = 0; x <= Board::kTilesMax; ++x) board.SetTile(static_cast<std::int64_t>(x), 0, "\1");
  EXPECT_NE(board.FindTiles(1, {{Board::kTilesMax - 1, 0}}), "");
  EXPECT_EQ(board.FindTiles(1, {{Board::kTilesMax, 0}}), "");
  board.SetTile(0, 0, "\2");  // A tile that is there still changes.
  EXPECT_EQ(board.FindTiles(1, {{0, 0}}).back(), '\2');
  std::vector<std::pair<std::int64_t, std::int64_t>> many;
  for (int x = 0; x < 1000; ++x) many.emplace_back(x, 0);
  EXPECT_EQ(board.FindTiles(1, many).size(), Board::kTilesAskedMax * 9);
}

TEST(BoardTest, AnAnswerHoldsALimitedNumberOfCells) {
  Board board("run");
  board.BeginMap({50'000, 512, ""});
  for (int x = 0; x < 4; ++x) board.SetTile(x, 0, std::string(512 * 512, '\1'));
  EXPECT_EQ(board.FindTiles(1, {{0, 0}, {1, 0}, {2, 0}, {3, 0}}).size(), 512u * 512 + 8);
}

TEST(BoardTest, AWaitEndsByAChangeAndByTheEnd) {
  Board board("run");
  const auto far = std::chrono::steady_clock::now() + std::chrono::hours(1);
  std::thread change([&board] { board.Set("team", "{}"); });
  board.WaitForChange(0, far);
  change.join();
  EXPECT_EQ(board.version(), 1u);
  std::thread end([&board] { board.End(); });
  board.WaitForChange(1, far);
  end.join();
}

TEST(BoardTest, DamagedBytesAreAnError) {
  EXPECT_EQ(Inflate("no zlib").error().code, ErrorCode::kCorrupt);
  const std::string deflated = Deflate(std::string(100'000, 'a'));
  EXPECT_EQ(Inflate(deflated).value(), std::string(100'000, 'a'));
  EXPECT_EQ(Inflate(deflated.substr(0, deflated.size() / 2)).error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace moondb
