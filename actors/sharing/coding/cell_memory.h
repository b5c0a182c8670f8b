// CellMemory: what a run remembers of a place, in one byte: what the last map said of it, what the maps before said,
// and how surely.
//
// One map has noise of its own; what several agree on foretells the next one better. Memory moves with the maps: each
// map's is its own cells over the memory of the map that it was placed in. Whole numbers, the same at both ends.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace moondb {

// Bits 0 and 1: the last map's cell; 2 and 3: what is believed; 4 and 5: how often that was confirmed.
using CellMemory = std::uint8_t;

inline constexpr std::uint8_t kNotCovered = 3;  // A cell of which no earlier map says anything.
inline constexpr CellMemory kNoMemory = kNotCovered | kNotCovered << 2;
inline constexpr std::size_t kMemoryStates = 16;

// The last map's cell, or kNotCovered.
constexpr std::uint32_t LastCell(CellMemory memory) { return memory & 3; }

// The same where what is not covered counts as unknown.
constexpr std::uint32_t LastOrUnknown(CellMemory memory) {
  return LastCell(memory) == kNotCovered ? 0 : LastCell(memory);
}

// After a map whose cell here is `cell`.
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

// Below kMemoryStates: the last cell, and whether the belief is the same (confirmed never, once, more often) or which
// other one.
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
