// What reads bytes of peers in actors/sharing, each behind one entry that takes any bytes: for libFuzzer
// (`cmake --preset fuzz`) and for fuzz_smoke_test.cc, which runs them everywhere.
#pragma once

#include <string_view>
#include <vector>

namespace moondb {

struct FuzzedDecoder {
  const char* name;  // Also of its folder in tests/fuzz/corpus.
  // Stops by Check where what was read does not come back the same when it is coded again.
  void (*run)(std::string_view bytes);
};

const std::vector<FuzzedDecoder>& FuzzedDecoders();

}  // namespace moondb
