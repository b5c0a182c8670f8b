// HashRecord: detects different contents under the same record key.
#pragma once

#include <cstdint>
#include <string_view>

#include "model/record_key.h"

namespace moondb {

// Returns the XXH64 (seed 0) of origin (u32), epoch (u64), type (u32) and seq (u64), all little-endian, followed by the
// content.
std::uint64_t HashRecord(const RecordKey& key, std::string_view content);

}  // namespace moondb
