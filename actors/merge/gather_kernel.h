// The inner loop of the gather on the CPU: one block of observations against the 64 squares of one tile.
//
// The same loop is compiled for each instruction set, from files with their own compiler flags; the one that runs is
// chosen at run time. Therefore nothing here may have external linkage but the four functions at the end: a function
// that two such files shared could be linked from the file for the newer processor. No standard containers either.
#pragma once

#include <cstdint>

namespace moondb {

// A block as one tile sees it. u and v are those of the tile's first cell, exact, in Q42.22.
struct KernelBlock {
  const std::uint32_t* words;        // As in PackedBlock; null for a footprint.
  const std::uint64_t* coarse_rows;  // As in PackedBlock; all bits set for a footprint.
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

// The arrays of a Tile.
struct KernelTile {
  std::uint64_t* known;
  std::uint64_t* hazard;
  std::uint16_t* weakest;
  std::uint16_t* winners;
};

struct KernelResult {
  std::uint64_t open;  // The squares that still have unknown cells, a bit each.
  bool has_won;        // The block gave a cell its value.
};

struct GatherKernel {
  const char* name;
  // Gives unknown cells in the squares of `open` what the block knows of them, and notes `winner` there.
  KernelResult (*gather)(const KernelBlock& block, const KernelTile& tile, std::uint64_t open, std::uint16_t winner);
  // Whether the block knows a cell that is not in `known` (of a Tile), or any cell of a square of `weaker`.
  bool (*would_win)(const KernelBlock& block, const std::uint64_t* known, std::uint64_t weaker);
  // The squares of the tile, a bit each, of which the block may know something.
  std::uint64_t (*may_know)(const KernelBlock& block);
};

// Null where this build has no such instructions. Whether the processor has them is the caller's question.
const GatherKernel* ScalarKernel();
const GatherKernel* Sse2Kernel();
const GatherKernel* Avx2Kernel();
const GatherKernel* Avx512Kernel();

}  // namespace moondb
