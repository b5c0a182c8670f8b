// Decoders of bytes from peers and clients, each behind an entry that accepts any bytes. libFuzzer (`cmake --preset
// fuzz`) and fuzz_smoke_test.cc run them.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "model/record_key.h"

namespace moondb {

// Key of the record in the statements of the corpus "sql", except for its data type.
inline const RecordKey kFuzzedSqlKey{{2, 0x5F3C9A1E0B7D4C21u, 0}, 1};

struct FuzzedDecoder {
  const char* name;  // Also the name of its folder in tests/fuzz/corpus.
  // Fails a Check if a decoded value differs after it is coded and decoded again.
  void (*run)(std::string_view bytes);
};

const std::vector<FuzzedDecoder>& FuzzedDecoders();

// Removes and returns the next number of `byte_count` bytes. Returns 0 at the end of the input.
std::size_t TakeNumber(std::size_t byte_count, std::string_view& bytes);

}  // namespace moondb
