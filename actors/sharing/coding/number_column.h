// A column of 64-bit numbers, coded as differences in byte planes for a general-purpose compressor.
//
//   column := way, first number, width, width planes of (count - 1) bytes, the lowest bytes first
//
// The field `way` selects how the numbers after the first are coded: as differences between neighbouring numbers, as
// differences of these differences (both in zigzag form), or as XOR with the preceding number. The encoder chooses the
// way with the fewest bits. Numbers that are constant or grow evenly become zeros. A double is coded as its 64 bits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "actors/sharing/coding/byte_text.h"

namespace moondb {

void PutColumn(const std::vector<std::uint64_t>& numbers, std::string& bytes);

// Reads a column of `count` numbers. Marks the reader as failed if the column is malformed. Takes at most 8 bytes of
// memory per number, even if the bytes are malformed.
std::vector<std::uint64_t> TakeColumn(std::size_t count, ByteReader& reader);

}  // namespace moondb
