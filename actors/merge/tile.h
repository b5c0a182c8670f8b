// The merged map in memory: sparse pages of 256 x 256 cells. A page has 16 tiles of 64 x 64 cells, and a tile 64
// squares of 8 x 8 cells.
//
// A square has 64 bits "known", 64 bits "hazard" and 64 winner numbers, each row by row from the lowest y. A winner
// number is an index in the tile's list of blocks, so 16 bits suffice for any number of maps.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "actors/merge/placement.h"
#include "actors/merge/quantize.h"
#include "model/grid.h"

namespace moondb {

inline constexpr int kPageSideBits = 8;
inline constexpr int kTileSideBits = 6;
inline constexpr int kSquareSideBits = 3;
inline constexpr std::int64_t kPageSideCells = 1 << kPageSideBits;
inline constexpr std::int64_t kTileSideCells = 1 << kTileSideBits;
inline constexpr std::int64_t kSquareSideCells = 1 << kSquareSideBits;
inline constexpr std::size_t kTilesInPage = 16;
inline constexpr std::size_t kSquaresInTile = 64;
inline constexpr std::size_t kCellsInTile = 4096;

// Position of a page. The page contains the cells (x, y) with x >> 8 and y >> 8 equal to these numbers.
struct PageKey {
  std::int32_t x = 0;
  std::int32_t y = 0;
  auto operator<=>(const PageKey&) const = default;
};

struct PageKeyHash {
  std::size_t operator()(const PageKey& key) const {
    const std::uint64_t both =
        static_cast<std::uint64_t>(static_cast<std::uint32_t>(key.y)) << 32 | static_cast<std::uint32_t>(key.x);
    return static_cast<std::size_t>((both ^ both >> 29) * 0x9E3779B97F4A7C15u);
  }
};

struct Tile {
  // For each square, one bit per cell.
  std::array<std::uint64_t, kSquaresInTile> known;
  std::array<std::uint64_t, kSquaresInTile> hazard;
  // For each square: the winner with the lowest priority among its known cells. Undefined if the square has no known
  // cell.
  std::array<std::uint16_t, kSquaresInTile> weakest;
  // Index in `blocks` of each cell's winner, square by square. Undefined for an unknown cell.
  std::array<std::uint16_t, kCellsInTile> winners;
  std::vector<const PlacedBlock*> blocks;  // The tile's winners; each won at least one cell.

  Cell At(std::size_t square, std::size_t cell) const {
    if ((known[square] >> cell & 1) == 0) return Cell::kUnknown;
    return (hazard[square] >> cell & 1) != 0 ? Cell::kHazard : Cell::kFree;
  }
  // Returns the block that won the cell; null if the cell is unknown.
  const PlacedBlock* WinnerAt(std::size_t square, std::size_t cell) const {
    return (known[square] >> cell & 1) == 0 ? nullptr : blocks[winners[square * 64 + cell]];
  }
};

struct Page {
  std::array<std::unique_ptr<Tile>, kTilesInPage> tiles;  // Tiles row by row; null for a tile without a known cell.
  // For each tile: version of the merge that last changed a value in the tile; 0 if no merge did.
  std::array<std::uint64_t, kTilesInPage> versions{};
};

// Returns the box of a page. The second function returns the box of one tile of the page.
inline CellBox BoxOf(const PageKey& key) {
  const std::int64_t x = std::int64_t{key.x} * kPageSideCells;
  const std::int64_t y = std::int64_t{key.y} * kPageSideCells;
  return {x, y, x + kPageSideCells - 1, y + kPageSideCells - 1};
}
inline CellBox BoxOf(const PageKey& key, std::size_t tile) {
  const std::int64_t x = std::int64_t{key.x} * kPageSideCells + static_cast<std::int64_t>(tile % 4) * kTileSideCells;
  const std::int64_t y = std::int64_t{key.y} * kPageSideCells + static_cast<std::int64_t>(tile / 4) * kTileSideCells;
  return {x, y, x + kTileSideCells - 1, y + kTileSideCells - 1};
}

inline PageKey PageAt(std::int64_t x, std::int64_t y) {
  return {static_cast<std::int32_t>(x >> kPageSideBits), static_cast<std::int32_t>(y >> kPageSideBits)};
}

// Calls visit(page key, index of the tile in the page, box of the tile) for each tile that touches `box`, even if the
// tile's page does not exist.
template <typename Visit>
void ForEachTile(const CellBox& box, Visit visit) {
  if (box.is_empty()) return;
  for (std::int64_t y = box.first_y >> kTileSideBits; y <= box.last_y >> kTileSideBits; ++y) {
    for (std::int64_t x = box.first_x >> kTileSideBits; x <= box.last_x >> kTileSideBits; ++x) {
      const PageKey key = PageAt(x * kTileSideCells, y * kTileSideCells);
      const auto tile = static_cast<std::size_t>((y & 3) * 4 + (x & 3));
      visit(key, tile, BoxOf(key, tile));
    }
  }
}

}  // namespace moondb
