#include "actors/merge/open_tile.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace moondb {
namespace {

static_assert(std::endian::native == std::endian::little, "a pixel's lowest byte comes first");

// Calls visit(winner) for each known cell. Stops when visit returns false.
template <typename Visit>
void VisitWinners(Tile& tile, Visit visit) {
  for (std::size_t square = 0; square < kSquaresInTile; ++square) {
    std::uint16_t* winners = tile.winners.data() + 64 * square;
    for (std::uint64_t cells = tile.known[square]; cells != 0; cells &= cells - 1) {
      if (!visit(winners[std::countr_zero(cells)])) return;
    }
  }
}

// Returns the lowest bit of each of the eight bytes. The first byte's bit becomes the lowest bit of the result.
std::uint64_t LowestBits(std::uint64_t bytes) { return (bytes & 0x0101010101010101) * 0x0102040810204080 >> 56; }

void ReadSquare(const std::array<std::uint8_t, 64>& drawn, std::size_t first_block, std::size_t square, Tile& tile) {
  std::uint64_t free = 0;
  std::uint64_t hazard = 0;
  for (std::size_t y = 0; y < 8; ++y) {
    std::uint64_t row;
    std::memcpy(&row, drawn.data() + 8 * y, sizeof(row));
    free |= LowestBits(row) << (8 * y);
    hazard |= LowestBits(row >> 1) << (8 * y);
  }
  const std::uint64_t taken = (free | hazard) & ~tile.known[square];
  if (taken == 0) return;
  std::uint16_t* winners = tile.winners.data() + 64 * square;
  std::uint8_t last = 0;
  const auto take = [&](std::size_t cell) {
    last = std::max(last, drawn[cell]);
    winners[cell] = static_cast<std::uint16_t>(first_block + (drawn[cell] >> 2));
  };
  if (tile.known[square] == 0) {
    // The winner of an unknown cell is never used, so the winners of all 64 cells may be written.
    for (std::size_t cell = 0; cell < drawn.size(); ++cell) take(cell);
  } else {
    for (std::uint64_t cells = taken; cells != 0; cells &= cells - 1) {
      take(static_cast<std::size_t>(std::countr_zero(cells)));
    }
  }
  tile.known[square] |= taken;
  tile.hazard[square] |= hazard & taken;
  tile.weakest[square] = static_cast<std::uint16_t>(first_block + (last >> 2));
}

}  // namespace

void ReadRound(std::span<const std::uint64_t> pixels, std::size_t columns, OpenTile& open) {
  const std::size_t width = columns * kSquarePixelsX;
  std::array<std::uint8_t, 64> drawn;
  std::size_t place = open.first_place;
  for (std::uint64_t todo = open.squares; todo != 0; todo &= todo - 1, ++place) {
    const auto square = static_cast<std::size_t>(std::countr_zero(todo));
    const std::size_t pixel = place / columns * kSquarePixelsY * width + place % columns * kSquarePixelsX;
    std::memcpy(drawn.data(), &pixels[pixel], 32);
    std::memcpy(drawn.data() + 32, &pixels[pixel + width], 32);
    ReadSquare(drawn, open.first_block, square, *open.tile);
    if (~open.tile->known[square] == 0) open.open &= ~(std::uint64_t{1} << square);
  }
}

void DropLosers(Tile& tile) {
  std::vector<std::uint16_t> numbers(tile.blocks.size());
  std::size_t losers = numbers.size();
  VisitWinners(tile, [&](std::uint16_t winner) {
    losers -= numbers[winner] == 0 ? 1 : 0;
    numbers[winner] = 1;
    return losers > 0;
  });
  if (losers == 0) return;
  std::uint16_t count = 0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] == 0) continue;
    tile.blocks[count] = tile.blocks[i];
    numbers[i] = count++;
  }
  tile.blocks.resize(count);
  VisitWinners(tile, [&](std::uint16_t& winner) {
    winner = numbers[winner];
    return true;
  });
  for (std::size_t square = 0; square < kSquaresInTile; ++square) {
    if (tile.known[square] != 0) tile.weakest[square] = numbers[tile.weakest[square]];
  }
}

}  // namespace moondb
