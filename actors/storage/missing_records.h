// FindMissing: what a destination lacks of what is held here, and the facts about dropped records that may follow.
//
// Order: sharing class first (SharingRules::RankOf), then epoch, then seq. `dropped` is filled only when nothing
// remains beyond the returned records: what is superseded must not go before its superseder arrives. Optimized poses
// and verdicts under `optimized_poses_of_agent` give no drops at all, because their superseders may be filtered out;
// nor do types under `newest_only_types`, whose older records are still held here.
//
// With a mark, records that came after it do not count, so that a session to a destination ends while the robot goes on
// inserting. Types under the policy `latest` or under `newest_only_types` are excepted: a newer record may have
// replaced the one that was marked.
#pragma once

#include "actors/storage/sharing_rules.h"
#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/storage.pb.h"

namespace moondb {

// Limits of one reply; what a request leaves at 0 or sets higher becomes the first or the last of a pair.
inline constexpr std::uint32_t kMissingBytesDefault = 64 * 1024;
inline constexpr std::uint32_t kMissingBytesMax = 16 * 1024 * 1024;
inline constexpr std::uint32_t kMissingRecordsDefault = 256;
inline constexpr std::uint32_t kMissingRecordsMax = 4096;

// `have` is this agent's own. `brings_others`: whether others take other agents' records from it; else it offers its
// own and what is signed by whoever made it. `marked`: what this agent held when the request's mark was set; null:
// there is no mark. Fails as Database does; kInvalid where destination_have is malformed.
Result<proto::MissingReply> FindMissing(Database& database, const HaveSet& have, const SharingRules& rules,
                                        bool brings_others, const HaveSet* marked,
                                        const proto::MissingRequest& request);

}  // namespace moondb
