// A column of 64-bit numbers as differences in planes of bytes, ready for a general compressor.
//
//   column := way, first number, width, width planes of (count - 1) bytes, the lowest bytes first
//
// `way` is what is left of each number but the first: its difference to the one before, the difference of that to the
// difference before, both zigzag, or its XOR with the one before. The encoder takes the way with the fewest bits;
// numbers that grow evenly, or do not change, leave nothing but zeros. Doubles travel as their bits, whatever these
// are. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "actors/sharing/coding/byte_text.h"

namespace moondb {

void PutColumn(const std::vector<std::uint64_t>& numbers, std::string& bytes);

// The next `count` numbers; the reader is no longer good if there are none of this form. Takes at most 8 bytes of
// memory a number, whatever the bytes say.
std::vector<std::uint64_t> TakeColumn(std::size_t count, ByteReader& reader);

}  // namespace moondb
