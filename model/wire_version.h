// The version of what agents send each other. Each Hello says it, and one of another version is refused.
//
// docs/COMPATIBILITY.md says which changes raise it; tests/runtime/transport/golden/wire_v1.txt has its fields,
// tests/actors/sharing/golden_batches_test.cc its coded records.
#pragma once

#include <cstdint>

namespace moondb {

inline constexpr std::uint32_t kWireVersion = 1;

}  // namespace moondb
