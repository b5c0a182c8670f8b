// Verify and TakeFingerprint: checks of a store for an operator.
//
// Verify checks rows against their hashes and against the have-set. TakeFingerprint combines the hashes of some records
// of a stream, for a comparison with another agent. Both functions change nothing, and process a bounded part per call,
// so storage can handle other requests in between. Records may be stored or superseded between two calls, because each
// part is checked against the have-set at the time of its call. Key and `content` are read, but not the columns derived
// from them (schema.h).
#pragma once

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::uint32_t kVerifyRecordsMax = 2000;  // Maximum records per reply.
// Limit of the bytes of contents per reply. One record may exceed this limit.
inline constexpr std::uint32_t kVerifyBytesMax = 4 * 1024 * 1024;
inline constexpr int kVerifyFindingsMax = 100;  // Maximum findings named per reply.

// Checks one part of the store. `have` is this agent's own have-set. If the file is damaged, VERIFY_PART_FILE reports
// the damage as a finding; the other parts fail with kCorrupt. Fails with kInvalid if the part is unknown. Other errors
// are as for Database.
Result<proto::VerifyReply> Verify(Database& database, const HaveSet& have, const proto::VerifyRequest& request);

// Returns the XOR of the hashes of the requested records that are stored here. One call reads a limited number of
// records; FingerprintReply.last_seq shows where to continue. Fails with kInvalid if the request's stream is malformed
// or of an unknown type. Other errors are as for Database.
Result<proto::FingerprintReply> TakeFingerprint(Database& database, const proto::FingerprintRequest& request);

}  // namespace moondb
