#include "runtime/team/record_signature.h"

#include "model/team_member.h"
#include "runtime/team/signing_key.h"

namespace moondb {
namespace {

constexpr char kRecordPurpose[] = "moondb record 1";

}  // namespace

std::string SignedBytes(const proto::TeamConfig& team, const RecordKey& key, const proto::Record& record) {
  proto::Record unsigned_record = record;
  unsigned_record.mutable_map_quarantine()->clear_signature();
  // The concatenation is unambiguous: purpose and id have fixed lengths, and the length of the key precedes the key.
  const std::string key_bytes = ToProto(key).SerializeAsString();
  return kRecordPurpose + team.team_id() + static_cast<char>(key_bytes.size()) + key_bytes +
         unsigned_record.SerializeAsString();
}

bool IsSigned(const proto::TeamConfig& team, const RecordKey& key, const proto::Record& record) {
  const proto::AgentConfig* origin = FindAgent(team, key.stream.origin);
  return origin != nullptr && record.has_map_quarantine() &&
         IsSignatureOf(origin->signing_key(), SignedBytes(team, key, record), record.map_quarantine().signature());
}

}  // namespace moondb
