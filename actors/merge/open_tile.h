// OpenTile: a tile that GlGather fills by drawing it once or several times (rounds), and functions that copy the drawn
// pixels into the tile.
//
// Value types and pure functions, usable on any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "actors/merge/gather_backend.h"
#include "actors/merge/tile.h"

namespace moondb {

// Width and height, in pixels of the render target, of a square of 8 x 8 cells. Each pixel holds one row of 8 cells.
// The lower pixel row holds the square's rows 0 to 3, from left to right, and the upper pixel row holds rows 4 to 7.
inline constexpr std::size_t kSquarePixelsX = 4;
inline constexpr std::size_t kSquarePixelsY = 2;

struct OpenTile {
  GatherWork* work = nullptr;
  std::size_t index = 0;  // Index of the tile in its page.
  CellBox box;
  const std::vector<OrderedBlock>* list = nullptr;  // Blocks of the tile's page.
  std::size_t next = 0;                             // Index in `list` of the first block that still has to be drawn.
  std::uint64_t open = ~std::uint64_t{0};           // Squares with unknown cells, one bit each.
  std::unique_ptr<Tile> tile;                       // Null until a block is listed for the tile.
  bool is_for_cpu = false;
  // Squares drawn in the current round, one bit each. In the target, these squares occupy consecutive places from
  // first_place on.
  std::uint64_t squares = 0;
  std::size_t first_place = 0;
  std::size_t first_block = 0;  // Index in tile->blocks of the first block of the current round.
};

// Copies the squares that a round has drawn from the target's `pixels` into the tile. `columns`: number of squares in a
// row of the target. Each byte of a pixel is one cell, the first cell in the lowest byte. The byte holds the cell's
// value in bits 0 and 1, and the number of the winning block within the round in bits 2 to 7.
void ReadRound(std::span<const std::uint64_t> pixels, std::size_t columns, OpenTile& open);

// Removes from tile.blocks the blocks that won no cell.
void DropLosers(Tile& tile);

}  // namespace moondb
