// ChooseToPrune: the rows that a PruneRequest (proto/retention.proto) may take away, oldest first.
//
// Only shared records under the policy `all` that are held here and that every one of `acknowledged` had; of some types
// only where the request names them (model/prune_rules.h). Where bundles for the ground were ever made
// (actors/storage/bundle_shelf.h), of the types that go there (SharingRules::for_ground) only what is in one: it keeps
// a copy of its own. A record whose stamp comes from a suspect clock is of unknown age: no `older_than_s` takes it.
//
// Looks at keys, stamps and lengths of all that may go, not at contents (but for what is old enough, to see whether its
// stamp can be trusted).
#pragma once

#include <cstdint>
#include <vector>

#include "actors/storage/record_tables.h"
#include "actors/storage/sharing_rules.h"
#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/retention.pb.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::size_t kPruneRowsMax = 2000;                        // Of one request that removes,
inline constexpr std::uint64_t kPruneContentBytesMax = 64 * 1024 * 1024;  // of contents, or one larger record.
inline constexpr int kPruneNamedMax = 4096;                               // PruneRequest.records.
inline constexpr std::size_t kPruneCandidatesMax = 262'144;  // Of more, the oldest of the streams that come first.

struct PruneChoice {
  struct Chosen {
    const RecordTable* table = nullptr;
    std::int64_t timestamp_ns = 0;
    RecordTable::Row row;  // Without hash and latest key.
  };
  std::vector<Chosen> rows;
  double unacknowledged_count = 0;  // Would have been candidates too.
  bool is_complete = true;          // Else more may go, beyond a limit above.
};

// The request's numbers: kInvalid, with the field named, for one that is negative, none or too large.
Result<void> CheckPruneLimits(const proto::PruneRequest& request);

// `have` is this agent's own, `utc_now_ns` since 1970. kInvalid, with the field named: nobody's have-set or a malformed
// one, too many records, a number that is negative or none; else fails as Database does.
Result<PruneChoice> ChooseToPrune(Database& database, const HaveSet& have, const SharingRules& rules,
                                  const proto::PruneRequest& request, std::int64_t utc_now_ns);

}  // namespace moondb
