// Validates records on their way into the store: the agents that they name, and that key, content and hash match.
// model/record_check.h checks the fields of a record.
#pragma once

#include <cstdint>
#include <set>

#include "model/error.h"
#include "model/ids.h"
#include "model/record_key.h"
#include "proto/record.pb.h"

namespace moondb {

// Runs CheckRecord. Also returns kInvalid, with the field named, if the record names an agent that is not in `team`.
// CheckSpeaker (model/record_authority.h) decides whether the origin may write the record.
Result<void> CheckTeamRecord(const proto::Record& record, const std::set<AgentId>& team);

// Returns the record inside `stored`, which came from a peer.
//   - kInvalid: unknown origin, no epoch, seq outside 1 to 2^63 - 1, a type without a table (every custom id has one),
//     content of another type, or an error of CheckTeamRecord.
//   - kCorrupt: wrong hash, content that does not parse or is longer than kRecordContentBytesMax.
Result<proto::Record> OpenStored(const proto::StoredRecord& stored, const std::set<AgentId>& team);

// Serialises a record deterministically. Its origin does this once; the bytes never change afterwards.
std::string SerializeRecord(const proto::Record& record);

}  // namespace moondb
