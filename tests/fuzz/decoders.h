// What reads bytes of peers, and of clients, each behind one entry that takes any bytes: for libFuzzer (`cmake --preset
// fuzz`) and for fuzz_smoke_test.cc, which runs them everywhere.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "model/record_key.h"

namespace moondb {

// Which record the statements in the corpus of "sql" are about, but for its data type.
inline const RecordKey kFuzzedSqlKey{{2, 0x5F3C9A1E0B7D4C21u, 0}, 1};

struct FuzzedDecoder {
  const char* name;  // Also of its folder in tests/fuzz/corpus.
  // Stops by Check where what was read does not come back the same when it is coded again.
  void (*run)(std::string_view bytes);
};

const std::vector<FuzzedDecoder>& FuzzedDecoders();

// Takes the next number of so many bytes off; 0 where there are none left.
std::size_t TakeNumber(std::size_t byte_count, std::string_view& bytes);

}  // namespace moondb
