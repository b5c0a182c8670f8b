// The version of the protocol between agents. Each Hello contains it; an agent refuses a Hello with another version.
//
// docs/COMPATIBILITY.md lists the changes that increase the version. tests/runtime/transport/golden/wire_v1.txt fixes
// the fields of this version; tests/actors/sharing/golden_batches_test.cc fixes the coding of records.
#pragma once

#include <cstdint>

namespace moondb {

inline constexpr std::uint32_t kWireVersion = 1;

}  // namespace moondb
