// RecordKey: the name of one shared record for ever, and the hash that tells two contents under one name apart.
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <string_view>

#include "model/error.h"
#include "model/ids.h"

namespace moondb::proto {
class RecordKey;
}  // namespace moondb::proto

namespace moondb {

// Of a record that is shared; a row keeps it as a signed number.
inline constexpr std::uint64_t kSeqMax = INT64_MAX;

// One stream of records: gap-free seqs from 1 within it.
struct StreamKey {
  AgentId origin = 0;
  std::uint64_t epoch = 0;
  DataType type = 0;
  auto operator<=>(const StreamKey&) const = default;
};

struct RecordKey {
  StreamKey stream;
  std::uint64_t seq = 0;
  auto operator<=>(const RecordKey&) const = default;
};

RecordKey FromProto(const proto::RecordKey& key);
proto::RecordKey ToProto(const RecordKey& key);

// "2.5f3c9a1e0b7d4c21.30.17": origin, epoch as 16 hexadecimal digits, data type, seq. Never compare keys as text.
std::string ToString(const RecordKey& key);

// Reads that form; kInvalid otherwise.
Result<RecordKey> ParseRecordKey(std::string_view text);

// XXH64 (seed 0) over origin u32, epoch u64, type u32, seq u64, all little-endian, then the content.
std::uint64_t HashRecord(const RecordKey& key, std::string_view content);

}  // namespace moondb
