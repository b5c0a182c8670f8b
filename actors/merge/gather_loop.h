// Code that each kernel file includes and compiles for its own instruction set. Nothing in this header may have
// external linkage (reason: gather_kernel.h).
#pragma once

#include <cstdint>

#include "actors/merge/gather_kernel.h"

namespace moondb {
namespace {

constexpr int kFraction = 22;
constexpr std::int64_t kCell = std::int64_t{1} << kFraction;

// The block's values for the 64 cells of a square, with one bit per cell in each mask.
struct Seen {
  std::uint64_t known = 0;
  std::uint64_t hazard = 0;
};

// Ranges of the block coordinates u and v (KernelBlock) over the cells of a square, relative to the square's first
// cell.
struct SquareReach {
  explicit SquareReach(const KernelBlock& block) {
    const std::int64_t c = 7 * block.step_cos;
    const std::int64_t s = 7 * block.step_sin;
    u_low = (c < 0 ? c : 0) + (s < 0 ? s : 0);
    u_high = (c > 0 ? c : 0) + (s > 0 ? s : 0);
    v_low = (c < 0 ? c : 0) + (s > 0 ? -s : 0);
    v_high = (c > 0 ? c : 0) + (s < 0 ? -s : 0);
  }
  std::int64_t u_low;
  std::int64_t u_high;
  std::int64_t v_low;
  std::int64_t v_high;
};

// Returns true if 32-bit coordinates suffice. They wrap around every 1024 cells of the block. If a square that touches
// the block spans fewer than 500 cells, none of its cells outside the block can wrap to a position inside the block.
[[maybe_unused]] inline bool HasSmallSteps(const SquareReach& reach) {
  return reach.u_high - reach.u_low < 500 * kCell;
}

// Returns the squares of the tile, one bit each, whose bounding box in the block's frame overlaps the block.
[[maybe_unused]] inline std::uint64_t TouchedOneByOne(const KernelBlock& block, const SquareReach& reach) {
  std::uint64_t touched = 0;
  for (int y = 0; y < 8; ++y) {
    std::int64_t u = block.u + y * 8 * block.step_sin;
    std::int64_t v = block.v + y * 8 * block.step_cos;
    for (int x = 0; x < 8; ++x) {
      const bool is_touched = (u + reach.u_high >= 0) & (u + reach.u_low < block.width_q) & (v + reach.v_high >= 0) &
                              (v + reach.v_low < block.height_q);
      touched |= static_cast<std::uint64_t>(is_touched) << (y * 8 + x);
      u += 8 * block.step_cos;
      v -= 8 * block.step_sin;
    }
  }
  return touched;
}

// Returns the block's values for the `wanted` cells of a square. Looks up each cell separately, which works for steps
// of any size. The bits of cells outside `wanted` are unspecified.
[[maybe_unused]] inline Seen ObserveOneByOne(const KernelBlock& block, std::int64_t first_u, std::int64_t first_v,
                                             std::uint64_t wanted) {
  Seen seen;
  for (int y = 0; y < 8; ++y) {
    if ((wanted >> (y * 8) & 255) == 0) continue;
    std::int64_t u = first_u + y * block.step_sin;
    std::int64_t v = first_v + y * block.step_cos;
    for (int x = 0; x < 8; ++x, u += block.step_cos, v -= block.step_sin) {
      if (static_cast<std::uint64_t>(u) >= static_cast<std::uint64_t>(block.width_q) ||
          static_cast<std::uint64_t>(v) >= static_cast<std::uint64_t>(block.height_q)) {
        continue;
      }
      std::uint64_t cell = 1;
      if (block.words != nullptr) {
        const std::int64_t column = u >> kFraction;
        cell = block.words[(column >> 4) * block.strip_words + (v >> kFraction)] >> (2 * (column & 15)) & 3;
      }
      seen.known |= static_cast<std::uint64_t>(cell != 0) << (y * 8 + x);
      seen.hazard |= (cell >> 1) << (y * 8 + x);
    }
  }
  return seen;
}

[[maybe_unused]] inline void StoreWinnersOneByOne(std::uint16_t* winners, std::uint64_t taken, std::uint16_t winner) {
  if (taken == ~std::uint64_t{0}) {
    for (int i = 0; i < 64; ++i) winners[i] = winner;
    return;
  }
  for (; taken != 0; taken &= taken - 1) winners[__builtin_ctzll(taken)] = winner;
}

// Coordinates of a square's first cell in the block's frame.
struct SquarePlace {
  SquarePlace(const KernelBlock& block, int square) {
    const std::int64_t x = (square & 7) * 8;
    const std::int64_t y = (square >> 3) * 8;
    u = block.u + x * block.step_cos + y * block.step_sin;
    v = block.v - x * block.step_sin + y * block.step_cos;
  }
  std::int64_t u;
  std::int64_t v;
};

// Looks up a square in the coarse bitmap. Returns true if the block may have a known cell in the square, and false if
// it certainly has none. Requires: the square touches the block.
[[maybe_unused]] inline bool MayKnow(const KernelBlock& block, const SquareReach& reach, const SquarePlace& place) {
  const std::int64_t u = place.u + reach.u_low;
  const std::int64_t v = place.v + reach.v_low;
  const std::int64_t column = (u < 0 ? 0 : u) >> (kFraction + block.coarse_shift);
  const std::int64_t row = (v < 0 ? 0 : v) >> (kFraction + block.coarse_shift);
  return (block.coarse_rows[row] >> column & 1) != 0;
}

// Returns true if the tile's bounding box in the block's frame overlaps the block.
[[maybe_unused]] inline bool MeetsTile(const KernelBlock& block, const SquareReach& reach) {
  return (block.u + 9 * reach.u_high >= 0) & (block.u + 9 * reach.u_low < block.width_q) &
         (block.v + 9 * reach.v_high >= 0) & (block.v + 9 * reach.v_low < block.height_q);
}

// Applies a block to a tile (GatherKernel::gather). View is the kernel's class, with the constructor View(block,
// reach), the member See(u, v, wanted), and the static members Touched(block, reach) and StoreWinners(winners, taken,
// winner).
template <typename View>
KernelResult GatherInto(const KernelBlock& block, const KernelTile& tile, std::uint64_t open, std::uint16_t winner) {
  KernelResult result{open, false};
  const SquareReach reach(block);
  if (!MeetsTile(block, reach)) return result;
  std::uint64_t todo = View::Touched(block, reach) & open;
  if (todo == 0) return result;
  const View view(block, reach);
  for (; todo != 0; todo &= todo - 1) {
    const int square = __builtin_ctzll(todo);
    const SquarePlace place(block, square);
    if (!MayKnow(block, reach, place)) continue;
    const std::uint64_t unknown = ~tile.known[square];
    const Seen seen = view.See(place.u, place.v, unknown);
    const std::uint64_t taken = seen.known & unknown;
    if (taken == 0) continue;
    View::StoreWinners(tile.winners + square * 64, taken, winner);
    tile.known[square] |= taken;
    tile.hazard[square] |= taken & seen.hazard;
    tile.weakest[square] = winner;
    result.has_won = true;
    if (taken == unknown) result.open &= ~(std::uint64_t{1} << square);
  }
  return result;
}

template <typename View>
bool WouldWin(const KernelBlock& block, const std::uint64_t* known, std::uint64_t weaker) {
  const SquareReach reach(block);
  if (!MeetsTile(block, reach)) return false;
  const View view(block, reach);
  for (std::uint64_t todo = View::Touched(block, reach); todo != 0; todo &= todo - 1) {
    const int square = __builtin_ctzll(todo);
    const std::uint64_t wanted = (weaker >> square & 1) != 0 ? ~std::uint64_t{0} : ~known[square];
    if (wanted == 0) continue;
    const SquarePlace place(block, square);
    if (!MayKnow(block, reach, place)) continue;
    if ((view.See(place.u, place.v, wanted).known & wanted) != 0) return true;
  }
  return false;
}

template <typename View>
std::uint64_t SquaresThatMayKnow(const KernelBlock& block) {
  const SquareReach reach(block);
  if (!MeetsTile(block, reach)) return 0;
  std::uint64_t squares = 0;
  for (std::uint64_t todo = View::Touched(block, reach); todo != 0; todo &= todo - 1) {
    const int square = __builtin_ctzll(todo);
    const bool may_know = MayKnow(block, reach, SquarePlace(block, square));
    squares |= static_cast<std::uint64_t>(may_know) << square;
  }
  return squares;
}

}  // namespace
}  // namespace moondb
