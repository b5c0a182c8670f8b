#include "actors/merge/open_tile.h"

#include <gtest/gtest.h>

#include <array>

namespace moondb {
namespace {

constexpr std::size_t kColumns = 3;  // Squares per row of `pixels_`.

class OpenTileTest : public testing::Test {
 protected:
  OpenTileTest() {
    open_.tile = std::make_unique<Tile>();
    for (PlacedBlock& block : blocks_) open_.tile->blocks.push_back(&block);
  }

  // Draws one cell of the square at `place` into `pixels_`. Cells that are not drawn are unknown.
  void Draw(std::size_t place, std::size_t cell, Cell value, std::size_t block) {
    const std::size_t row = cell / 8;
    const std::size_t x = place % kColumns * kSquarePixelsX + row % 4;
    const std::size_t y = place / kColumns * kSquarePixelsY + row / 4;
    std::uint64_t& pixel = pixels_[y * kColumns * kSquarePixelsX + x];
    pixel |= static_cast<std::uint64_t>(static_cast<std::uint64_t>(value) | block << 2) << (8 * (cell % 8));
  }

  const PlacedBlock* WinnerAt(std::size_t square, std::size_t cell) const { return open_.tile->WinnerAt(square, cell); }

  std::array<PlacedBlock, 3> blocks_;
  OpenTile open_;
  std::array<std::uint64_t, 2 * kColumns * kSquarePixelsX * kSquarePixelsY> pixels_{};
};

TEST_F(OpenTileTest, ReadsEachSquareFromItsPlace) {
  open_.squares = std::uint64_t{1} << 5 | std::uint64_t{1} << 63;
  open_.first_place = 2;  // Place 2 is the last place in its row, so the second square lies in the next row.
  for (std::size_t cell = 0; cell < 64; ++cell) Draw(2, cell, Cell::kFree, cell == 9 ? 2 : 1);
  Draw(3, 38, Cell::kHazard, 0);
  ReadRound(pixels_, kColumns, open_);
  EXPECT_EQ(open_.open, ~(std::uint64_t{1} << 5));
  EXPECT_EQ(~open_.tile->known[5], 0u);
  EXPECT_EQ(WinnerAt(5, 8), &blocks_[1]);
  EXPECT_EQ(WinnerAt(5, 9), &blocks_[2]);
  EXPECT_EQ(open_.tile->weakest[5], 2);
  EXPECT_EQ(open_.tile->known[63], std::uint64_t{1} << 38);
  EXPECT_EQ(open_.tile->At(63, 38), Cell::kHazard);
  EXPECT_EQ(WinnerAt(63, 38), &blocks_[0]);
}

TEST_F(OpenTileTest, ALaterRoundDecidesOnlyUnknownCells) {
  open_.squares = 1;
  Draw(0, 0, Cell::kHazard, 0);
  ReadRound(pixels_, kColumns, open_);
  pixels_ = {};
  open_.first_block = 1;
  Draw(0, 0, Cell::kFree, 1);
  Draw(0, 1, Cell::kFree, 1);
  ReadRound(pixels_, kColumns, open_);
  EXPECT_EQ(open_.tile->At(0, 0), Cell::kHazard);
  EXPECT_EQ(WinnerAt(0, 0), &blocks_[0]);
  EXPECT_EQ(open_.tile->At(0, 1), Cell::kFree);
  EXPECT_EQ(WinnerAt(0, 1), &blocks_[2]);
  EXPECT_EQ(open_.tile->weakest[0], 2);
}

TEST_F(OpenTileTest, RemovesBlocksThatWonNoCell) {
  open_.squares = 3;
  Draw(0, 7, Cell::kFree, 0);
  Draw(1, 8, Cell::kFree, 2);
  ReadRound(pixels_, kColumns, open_);
  DropLosers(*open_.tile);
  EXPECT_EQ(open_.tile->blocks, (std::vector<const PlacedBlock*>{&blocks_[0], &blocks_[2]}));
  EXPECT_EQ(WinnerAt(0, 7), &blocks_[0]);
  EXPECT_EQ(WinnerAt(1, 8), &blocks_[2]);
  EXPECT_EQ(open_.tile->weakest[0], 0);
  EXPECT_EQ(open_.tile->weakest[1], 1);
  DropLosers(*open_.tile);
  EXPECT_EQ(open_.tile->blocks.size(), 2u);
}

}  // namespace
}  // namespace moondb
