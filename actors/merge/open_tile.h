// OpenTile: a tile that GlGather fills in rounds, and what it takes over from the pixels of one.
//
// Plain values and pure functions, any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "actors/merge/gather_backend.h"
#include "actors/merge/tile.h"

namespace moondb {

// A square in a target: a pixel is a row of 8 cells, the lowest row first.
inline constexpr std::size_t kSquarePixelsX = 4;
inline constexpr std::size_t kSquarePixelsY = 2;

struct OpenTile {
  GatherWork* work = nullptr;
  std::size_t index = 0;  // In its page.
  CellBox box;
  const std::vector<OrderedBlock>* list = nullptr;  // Of its page.
  std::size_t next = 0;                             // In the list.
  std::uint64_t open = ~std::uint64_t{0};           // Squares with unknown cells.
  std::unique_ptr<Tile> tile;                       // Null until something may be known.
  bool is_for_cpu = false;
  // Of this round: its squares, which stand in the target one after the other, and what they are asked of.
  std::uint64_t squares = 0;
  std::size_t first_place = 0;
  std::size_t first_block = 0;  // Of the tile's.
};

// Takes over what a round drew of the tile's squares. In a target of rows of `columns` squares, a byte of a pixel is a
// cell, the first cell lowest: its value and, from bit 2 on, which of the round's blocks it is from.
void ReadRound(std::span<const std::uint64_t> pixels, std::size_t columns, OpenTile& open);

// Strikes blocks that were asked and won nothing.
void DropLosers(Tile& tile);

}  // namespace moondb
