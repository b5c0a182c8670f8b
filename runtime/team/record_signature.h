// Signatures of records that any agent may relay, made with the signing key of their origin. They protect map
// quarantines, which every agent holds and passes on. Role assignments carry the signature of their issuer instead
// (role_signature.h).
#pragma once

#include <string>

#include "model/record_key.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the bytes to sign: the purpose, the team id, the key of the record, and the record without its signature.
std::string SignedBytes(const proto::TeamConfig& team, const RecordKey& key, const proto::Record& record);

// Returns true if the signature matches the origin's key in the team file. False if the origin is not in the team or
// has no key, or if records of the type are not signed.
bool IsSigned(const proto::TeamConfig& team, const RecordKey& key, const proto::Record& record);

}  // namespace moondb
