// CellMemory: what the maps of a run showed at one place, in one byte. It contains the last map's cell, the cell value
// on which earlier maps agreed (the belief), and how often the belief was confirmed.
//
// A single map is noisy; a cell on which several maps agree predicts the next map better. The memory of a map consists
// of its own cells, merged with the memory of the previous map at the same places. Only integers are used, so encoder
// and decoder compute the same.
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

// Returns the memory of a place after another map, which has the value `cell` there.
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

// Makes the table that assigns to each CellMemory a state, a number below kMemoryStates. The state depends on the last
// cell. If the belief equals the last cell, the state also depends on how often the belief was confirmed: never, once,
// or at least twice. Otherwise the state also depends on the belief's value.
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
