// ChooseToPrune: selects the rows that a PruneRequest (proto/retention.proto) may remove, oldest first.
//
// A record is selected only if it is shared under the policy `all`, is held here, and is covered by every have-set in
// `acknowledged`. Some types are selected only if the request names them (model/prune_rules.h).
//
// If bundles for a ground station were ever made (actors/storage/bundle_shelf.h), records of the types in
// SharingRules::for_ground must also be in a bundle, which keeps its own copy. A record that is marked
// is_clock_suspect, or whose timestamp lies before 2020, has an unknown age, so `older_than_s` never selects it.
//
// Reads the keys, timestamps and lengths of all candidates. Reads contents only of records that are old enough, to
// check whether their timestamps can be trusted.
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

inline constexpr std::size_t kPruneRowsMax = 2000;  // Maximum rows per request that removes records.
// Maximum bytes of contents per request that removes records. One larger record is removed alone.
inline constexpr std::uint64_t kPruneContentBytesMax = 64 * 1024 * 1024;
inline constexpr int kPruneNamedMax = 4096;  // Maximum number of keys in PruneRequest.records.
// Maximum number of records that one request considers. If more records match, only the first ones in the order of
// streams are considered.
inline constexpr std::size_t kPruneCandidatesMax = 262'144;

struct PruneChoice {
  struct Chosen {
    const RecordTable* table = nullptr;
    std::int64_t timestamp_ns = 0;
    RecordTable::Row row;  // Hash and latest key are not filled.
  };
  std::vector<Chosen> rows;
  // Number of records that are not selected because `acknowledged` does not cover them.
  double unacknowledged_count = 0;
  // False if candidates were left out because of kPruneCandidatesMax, kPruneRowsMax, kPruneContentBytesMax, or
  // `rows_max` of RecordStore::Prune.
  bool is_complete = true;
};

// Fails with kInvalid, and names the field, if a number of the request is negative, not finite or too large.
Result<void> CheckPruneLimits(const proto::PruneRequest& request);

// Selects the records to prune. `have` is this agent's own have-set; `utc_now_ns` counts from 1970. Fails with
// kInvalid, and names the field, if `acknowledged` is empty or contains a malformed have-set, if the request names too
// many records, or if a number is invalid. Other errors are as for Database.
Result<PruneChoice> ChooseToPrune(Database& database, const HaveSet& have, const SharingRules& rules,
                                  const proto::PruneRequest& request, std::int64_t utc_now_ns);

}  // namespace moondb
