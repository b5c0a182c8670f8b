// Validates records before they are stored: a record may name only agents of the team, and its key, content and hash
// must match. model/record_check.h checks the fields of a record.
#pragma once

#include <cstdint>
#include <set>

#include "model/error.h"
#include "model/ids.h"
#include "model/record_key.h"
#include "proto/record.pb.h"

namespace moondb {

// Runs CheckRecord. Also fails with kInvalid, and names the field, if the record names an agent that is not in `team`.
// CheckSpeaker (model/record_authority.h) decides whether the origin may write the record.
Result<void> CheckTeamRecord(const proto::Record& record, const std::set<AgentId>& team);

// Returns the record inside `stored`, which came from a peer.
//   - Fails with kInvalid if the origin is unknown, the epoch is 0, the seq is outside 1 to 2^63 - 1, the type has no
//     table (each custom id has one), the content is of another type, or CheckTeamRecord fails.
//   - Fails with kCorrupt if the hash is wrong, or if the content does not parse or is longer than
//     kRecordContentBytesMax.
Result<proto::Record> OpenStored(const proto::StoredRecord& stored, const std::set<AgentId>& team);

// Serialises a record deterministically. Once the origin has stored a record, its bytes never change.
std::string SerializeRecord(const proto::Record& record);

}  // namespace moondb
