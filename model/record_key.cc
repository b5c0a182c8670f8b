#include "model/record_key.h"

#include <charconv>
#include <cinttypes>
#include <cstdio>

#include "proto/ids.pb.h"

namespace moondb {

namespace {

// Parses the number at the front of `text`, which must end before `end_mark`, or at the end of `text` if `end_mark` is
// 0. Removes the number and the mark from `text`. Returns false and leaves `text` unchanged if there is no such number.
template <typename T>
bool TakeNumber(std::string_view& text, char end_mark, int base, T& value) {
  const std::size_t end = end_mark ? text.find(end_mark) : text.size();
  if (end == std::string_view::npos || end == 0) return false;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + end, value, base);
  if (error != std::errc() || stop != text.data() + end) return false;
  text.remove_prefix(end_mark ? end + 1 : end);
  return true;
}

}  // namespace

RecordKey FromProto(const proto::RecordKey& key) {
  return RecordKey{StreamKey{key.origin_agent(), key.epoch(), key.data_type()}, key.seq()};
}

proto::RecordKey ToProto(const RecordKey& key) {
  proto::RecordKey result;
  result.set_origin_agent(key.stream.origin);
  result.set_epoch(key.stream.epoch);
  result.set_data_type(key.stream.type);
  result.set_seq(key.seq);
  return result;
}

std::string ToString(const RecordKey& key) {
  char buffer[80];
  std::snprintf(buffer, sizeof(buffer), "%" PRIu32 ".%016" PRIx64 ".%" PRIu32 ".%" PRIu64, key.stream.origin,
                key.stream.epoch, key.stream.type, key.seq);
  return buffer;
}

Result<RecordKey> ParseRecordKey(std::string_view text) {
  RecordKey key;
  std::string_view rest = text;
  if (!TakeNumber(rest, '.', 10, key.stream.origin) || !TakeNumber(rest, '.', 16, key.stream.epoch) ||
      !TakeNumber(rest, '.', 10, key.stream.type) || !TakeNumber(rest, '\0', 10, key.seq)) {
    return Fail(ErrorCode::kInvalid, "'" + std::string(text) + "' is not a record key (AGENT.EPOCH.TYPE.SEQ)");
  }
  return key;
}

}  // namespace moondb
