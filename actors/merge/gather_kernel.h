// The inner loop of the gather on the CPU: applies one block of observations to the 64 squares of one tile.
//
// The same loop is compiled once per instruction set, in files with their own compiler flags. The program chooses one
// version at run time. Only the four functions at the end of this header may have external linkage. If two such files
// defined the same external function, the linker could keep the copy that needs the newer processor. Standard
// containers are not allowed for the same reason.
#pragma once

#include <cstdint>

namespace moondb {

// A block as seen from one tile. u and v are the exact block coordinates of the tile's first cell, in Q42.22.
struct KernelBlock {
  const std::uint32_t* words;        // Same as PackedBlock::words(); null for a footprint.
  const std::uint64_t* coarse_rows;  // Same as PackedBlock::coarse_rows(); all bits set for a footprint.
  std::int32_t coarse_shift;
  std::int32_t strip_words;
  std::int32_t strip_count;
  std::int64_t u;
  std::int64_t v;
  std::int64_t step_cos;
  std::int64_t step_sin;
  std::int64_t width_q;
  std::int64_t height_q;
};

// Pointers to the arrays of a Tile.
struct KernelTile {
  std::uint64_t* known;
  std::uint64_t* hazard;
  std::uint16_t* weakest;
  std::uint16_t* winners;
};

struct KernelResult {
  std::uint64_t open;  // Squares that still have unknown cells, one bit each.
  bool has_won;        // True if the block gave a cell its value.
};

struct GatherKernel {
  const char* name;
  // Sets unknown cells in the squares of `open` to the block's known values, and stores `winner` as the source of these
  // cells.
  KernelResult (*gather)(const KernelBlock& block, const KernelTile& tile, std::uint64_t open, std::uint16_t winner);
  // Returns true if the block knows a cell that is not in `known` (Tile::known), or a cell of a square in `weaker` (one
  // bit per square).
  bool (*would_win)(const KernelBlock& block, const std::uint64_t* known, std::uint64_t weaker);
  // Returns the squares of the tile, one bit each, in which the block may have a known cell.
  std::uint64_t (*may_know)(const KernelBlock& block);
};

// Each function returns null if this build lacks the instruction set. Call a function only if the processor has the
// instruction set.
const GatherKernel* ScalarKernel();
const GatherKernel* Sse2Kernel();
const GatherKernel* Avx2Kernel();
const GatherKernel* Avx512Kernel();

}  // namespace moondb
