// CellMemory: what a run remembers of one place, in one byte: the cell of the last map, the cell on which earlier maps
// agreed (the belief), and how often it was confirmed.
//
// A single map is noisy; a cell on which several maps agree predicts the next map better. Memory moves with the maps:
// the memory of a map is its own cells merged over the memory of the previous map on which it was placed. Integers
// only, so both ends compute the same.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace moondb {

// Bits 0 and 1: the last map's cell. Bits 2 and 3: the believed cell. Bits 4 and 5: how often the belief was confirmed.
using CellMemory = std::uint8_t;

inline constexpr std::uint8_t kNotCovered = 3;  // A cell that no earlier map covers.
inline constexpr CellMemory kNoMemory = kNotCovered | kNotCovered << 2;
inline constexpr std::size_t kMemoryStates = 16;

// Returns the last map's cell, or kNotCovered.
constexpr std::uint32_t LastCell(CellMemory memory) { return memory & 3; }

// Returns the last map's cell, or 0 (unknown) if no map covers it.
constexpr std::uint32_t LastOrUnknown(CellMemory memory) {
  return LastCell(memory) == kNotCovered ? 0 : LastCell(memory);
}

// Returns the memory after a map whose cell at this place is `cell`.
constexpr CellMemory Remember(CellMemory memory, std::uint8_t cell) {
  constexpr int kSurest = 3;
  int belief = memory >> 2 & 3;
  int confirmed = memory >> 4 & 3;
  if (belief == cell) {
    if (confirmed < kSurest) ++confirmed;
  } else if (belief == kNotCovered || confirmed == 0) {
    belief = cell;
    confirmed = 0;
  } else {
    --confirmed;
  }
  return static_cast<CellMemory>(cell | belief << 2 | confirmed << 4);
}

// Maps a memory to a state below kMemoryStates, which combines the last cell with the belief: the same cell (never,
// once or more often confirmed), or one of the other cells.
constexpr std::array<std::uint8_t, 64> MakeMemoryStates() {
  std::array<std::uint8_t, 64> states{};
  for (int memory = 0; memory < 64; ++memory) {
    const int last = memory & 3, belief = memory >> 2 & 3, confirmed = memory >> 4;
    int state = kMemoryStates - 1;
    if (last != kNotCovered && belief != kNotCovered) {
      const int agreement = last == belief ? (confirmed > 2 ? 2 : confirmed) : 2 + (belief + 3 - last) % 3;
      state = last * 5 + agreement;
    }
    states[static_cast<std::size_t>(memory)] = static_cast<std::uint8_t>(state);
  }
  return states;
}

inline constexpr std::array<std::uint8_t, 64> kMemoryStateOf = MakeMemoryStates();

}  // namespace moondb
