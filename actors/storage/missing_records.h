// FindMissing returns the records that are held here and that a destination lacks, and the dropped seqs to report to
// the destination.
//
// Records are ordered by sharing class (SharingRules::RankOf), then by epoch, then by seq. `dropped` is filled only if
// the reply contains all remaining records, since the destination must not drop a record before its successor arrives.
// No dropped seqs are reported for streams that the filter passes only in part (`optimized_poses_of_agent`), because
// the filter may hide the successors. No dropped seqs are reported for `newest_only_types` either, because this agent
// still holds their older records.
//
// If the request has a mark (MissingRequest.mark), records that were inserted after the first request with this mark
// are left out. Otherwise a session would not end while the robot inserts records. Types under the policy `latest` or
// in `newest_only_types` ignore the mark, because a newer record may have replaced a record that existed at that first
// request.
#pragma once

#include "actors/storage/sharing_rules.h"
#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/storage.pb.h"

namespace moondb {

// Limits of one reply: the default, used if the request has 0, and the maximum.
inline constexpr std::uint32_t kMissingBytesDefault = 64 * 1024;
inline constexpr std::uint32_t kMissingBytesMax = 16 * 1024 * 1024;
inline constexpr std::uint32_t kMissingRecordsDefault = 256;
inline constexpr std::uint32_t kMissingRecordsMax = 4096;

// `have` is this agent's own have-set. `brings_others` is true if peers accept records of other agents from this agent.
// If `brings_others` is false, the reply contains only this agent's own records and records that are signed by their
// author. `marked` is the have-set at the time of the first request with the same mark; null if the request has no
// mark. Fails with kInvalid if destination_have is malformed. Other errors are as for Database.
Result<proto::MissingReply> FindMissing(Database& database, const HaveSet& have, const SharingRules& rules,
                                        bool brings_others, const HaveSet* marked,
                                        const proto::MissingRequest& request);

}  // namespace moondb
