// RecordKey: the permanent identifier of one shared record.
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

// Largest seq of a shared record, because the database stores a seq as a signed integer.
inline constexpr std::uint64_t kSeqMax = INT64_MAX;

// Identifies one stream of records. Seqs within a stream count from 1 without a gap.
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

// Returns the text form "2.5f3c9a1e0b7d4c21.30.17": origin, epoch as 16 hexadecimal digits, data type, seq. Do not
// compare keys in this form: text order differs from key order.
std::string ToString(const RecordKey& key);

// Parses the text form of ToString. Fails with kInvalid for other text.
Result<RecordKey> ParseRecordKey(std::string_view text);

}  // namespace moondb
