// Verify, TakeFingerprint: whether what is stored is what was stored, for an operator who wants to know.
//
// Verify holds rows against their hashes and against the have-set; TakeFingerprint sums up some of a stream's records,
// for a comparison with another agent's. Nothing is changed. Both take a bounded part at a time, so that storage is at
// work for others in between; what is stored, or superseded, meanwhile does no harm, as each part is judged by the
// have-set of its moment. Both look at `content` and key, not at the columns that are derived from them (schema.h).
#pragma once

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::uint32_t kVerifyRecordsMax = 2000;           // In one reply,
inline constexpr std::uint32_t kVerifyBytesMax = 4 * 1024 * 1024;  // of contents, or one larger record,
inline constexpr int kVerifyFindingsMax = 100;                     // and so many named.

// `have` is this agent's own. A damaged file is a finding of VERIFY_PART_FILE; in the other parts it is an error, as
// Database's. kInvalid: no part.
Result<proto::VerifyReply> Verify(Database& database, const HaveSet& have, const proto::VerifyRequest& request);

// kInvalid for what is no StreamHave of a type that is known here; else fails as Database does.
Result<proto::FingerprintReply> TakeFingerprint(Database& database, const proto::FingerprintRequest& request);

}  // namespace moondb
