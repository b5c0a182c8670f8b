// Verify and TakeFingerprint: checks of a store for an operator.
//
// Verify checks rows against their hashes and against the have-set. TakeFingerprint combines the hashes of some records
// of a stream, for a comparison with another agent. Neither changes anything. Both process a bounded part per call, so
// storage can handle other requests in between. Records stored or superseded meanwhile do no harm, because each part is
// checked against the have-set at the time of the call. Both read key and `content`, not the columns derived from them
// (schema.h).
#pragma once

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::uint32_t kVerifyRecordsMax = 2000;           // Records per reply.
inline constexpr std::uint32_t kVerifyBytesMax = 4 * 1024 * 1024;  // Bytes of contents per reply, or a larger record.
inline constexpr int kVerifyFindingsMax = 100;                     // Findings named per reply.

// `have` is this agent's own have-set. For VERIFY_PART_FILE, a damaged file is a finding of the reply. For the other
// parts, it is an error, as for Database. kInvalid if the part is unknown.
Result<proto::VerifyReply> Verify(Database& database, const HaveSet& have, const proto::VerifyRequest& request);

// kInvalid if the request's stream is malformed or of an unknown type. Other errors are as for Database.
Result<proto::FingerprintReply> TakeFingerprint(Database& database, const proto::FingerprintRequest& request);

}  // namespace moondb
