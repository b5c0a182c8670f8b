// Signatures of records that anybody may bring, by the signing key of their origin: quarantines of maps, which every
// agent holds and passes on, though it never led. Assignments have their issuer's (role_signature.h).
#pragma once

#include <string>

#include "model/record_key.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// What is signed: what it is for, whose team it is, under which key the record is held, and all that it says but for
// the signature.
std::string SignedBytes(const proto::TeamConfig& team, const RecordKey& key, const proto::Record& record);

// By its origin's key in the team file; false too where the origin is not of the team or has no key, and for a record
// of a type that is not signed.
bool IsSigned(const proto::TeamConfig& team, const RecordKey& key, const proto::Record& record);

}  // namespace moondb
