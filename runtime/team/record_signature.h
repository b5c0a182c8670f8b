// Signatures of records, made with the signing key of the record's origin, so that any agent may relay the record. Only
// map quarantines are signed. Role assignments carry the signature of their issuer (role_signature.h).
#pragma once

#include <string>

#include "model/record_key.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the bytes to sign: a constant text for this purpose, the team id, the key of the record, and the record
// without its signature.
std::string SignedBytes(const proto::TeamConfig& team, const RecordKey& key, const proto::Record& record);

// Returns true if the record's signature matches the origin's key in the team file. Returns false if the origin is not
// in the team or has no key, or if records of this type are not signed.
bool IsSigned(const proto::TeamConfig& team, const RecordKey& key, const proto::Record& record);

}  // namespace moondb
