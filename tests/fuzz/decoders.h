// Decoders of bytes from peers and clients, each wrapped in a function that accepts any bytes. libFuzzer (`cmake
// --preset fuzz`) and fuzz_smoke_test.cc call these functions.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "model/record_key.h"

namespace moondb {

// Key of every record in the corpus "sql". Only the data types differ.
inline const RecordKey kFuzzedSqlKey{{2, 0x5F3C9A1E0B7D4C21u, 0}, 1};

struct FuzzedDecoder {
  const char* name;  // Name of the decoder, and of its folder in tests/fuzz/corpus.
  // Decodes `bytes`. Check fails if a decoded value changes when it is coded and decoded again.
  void (*run)(std::string_view bytes);
};

const std::vector<FuzzedDecoder>& FuzzedDecoders();

// Removes the first `byte_count` bytes, or fewer at the end of the input, and returns them as a big-endian number.
std::size_t TakeNumber(std::size_t byte_count, std::string_view& bytes);

}  // namespace moondb
