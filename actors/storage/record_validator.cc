#include "actors/storage/record_validator.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <cstdint>
#include <string>

#include "actors/storage/record_tables.h"
#include "model/bounded_parse.h"
#include "model/record_check.h"
#include "model/record_hash.h"

namespace moondb {

namespace {

Result<void> CheckAgent(AgentId agent, const std::set<AgentId>& team, const std::string& field) {
  if (team.count(agent)) return {};
  return Fail(ErrorCode::kInvalid, "agent " + std::to_string(agent) + " is not in the team", field);
}

}  // namespace

Result<void> CheckTeamRecord(const proto::Record& record, const std::set<AgentId>& team) {
  if (const Result<void> checked = CheckRecord(record); !checked) return checked;
  for (const NamedAgent& named : AgentsNamedIn(record)) {
    if (const Result<void> known = CheckAgent(named.agent, team, named.field); !known) return known;
  }
  return {};
}

Result<proto::Record> OpenStored(const proto::StoredRecord& stored, const std::set<AgentId>& team) {
  const RecordKey key = FromProto(stored.key());
  if (const Result<void> known = CheckAgent(key.stream.origin, team, "key.origin_agent"); !known) {
    return tl::unexpected(known.error());
  }
  if (key.stream.epoch == 0) return Fail(ErrorCode::kInvalid, "is missing", "key.epoch");
  if (key.seq < 1 || key.seq > kSeqMax) return Fail(ErrorCode::kInvalid, "must be 1 to 2^63 - 1", "key.seq");
  if (!FindRecordTable(key.stream.type)) {
    return Fail(ErrorCode::kInvalid, "type " + std::to_string(key.stream.type) + " is unknown here", "key.data_type");
  }
  if (stored.content().size() > kRecordContentBytesMax) return Fail(ErrorCode::kCorrupt, "is too long", "content");
  if (HashRecord(key, stored.content()) != stored.hash()) {
    return Fail(ErrorCode::kCorrupt, "does not match key and content", "hash");
  }
  proto::Record record;
  if (!ParseBounded(stored.content(), &record)) return Fail(ErrorCode::kCorrupt, "does not parse", "content");
  if (TypeOf(record) != key.stream.type) {
    return Fail(ErrorCode::kInvalid, "content is of type " + DataTypeName(TypeOf(record)), "key.data_type");
  }
  if (const Result<void> checked = CheckTeamRecord(record, team); !checked) {
    return tl::unexpected(checked.error());
  }
  return record;
}

std::string SerializeRecord(const proto::Record& record) {
  std::string content;
  google::protobuf::io::StringOutputStream stream(&content);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  (void)record.SerializeToCodedStream(&coded);
  coded.Trim();
  return content;
}

}  // namespace moondb
