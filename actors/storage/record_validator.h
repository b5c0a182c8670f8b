// The door for records on their way into the store: whose they are, and whether key, content and hash fit together.
// What a record may hold is model/record_check.h's.
#pragma once

#include <cstdint>
#include <set>

#include "model/error.h"
#include "model/ids.h"
#include "model/record_key.h"
#include "proto/record.pb.h"

namespace moondb {

// CheckRecord, then kInvalid with the field for an agent that is not in `team`. Whether its origin may state the record
// is CheckSpeaker's (model/record_authority.h).
Result<void> CheckTeamRecord(const proto::Record& record, const std::set<AgentId>& team);

// The record inside `stored`, which came from a peer. kInvalid: origin unknown, no epoch, seq outside 1 to 2^63 - 1, a
// type without a table (any custom id has one), content of another type, or as in CheckTeamRecord. kCorrupt: wrong
// hash, content that does not parse or is longer than kRecordContentBytesMax.
Result<proto::Record> OpenStored(const proto::StoredRecord& stored, const std::set<AgentId>& team);

// The one serialisation of a record that its origin makes.
std::string SerializeRecord(const proto::Record& record);

}  // namespace moondb
