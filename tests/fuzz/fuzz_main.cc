// Main file of a libFuzzer program. The macro MOONDB_FUZZED is the name of the decoder to run.
#include <google/protobuf/stubs/logging.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "tests/fuzz/decoders.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const moondb::FuzzedDecoder* const decoder = [] {
    google::protobuf::SetLogHandler(nullptr);  // Silences protobuf's log, as agents do (runtime/log.cc).
    for (const moondb::FuzzedDecoder& each : moondb::FuzzedDecoders()) {
      if (std::strcmp(each.name, MOONDB_FUZZED) == 0) return &each;
    }
    __builtin_trap();
  }();
  decoder->run({reinterpret_cast<const char*>(data), size});
  return 0;
}
