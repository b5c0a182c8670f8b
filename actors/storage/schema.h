// The tables and views of an agent's store, and the check that a file is a store of this version.
//
// Each data type has one table (paper, Table 1) with typed columns for SQL. These columns are derived from `content`;
// only `content` is permanent and sent to peers. Row ids form one sequence over all of these tables, in the order of
// storing. epoch and seq are NULL if a row is not marked for sharing.
//
//   - have_interval: the held and dropped seqs. Hashes in this table and in role_history reveal damaged rows.
//   - replica, replication_log: views that show the paper's tables (Section 4) to people. The agent does not read these
//     views.
//   - custom_record: the records of all custom data types (proto/team.proto). The payload is a part of `content`. The
//     view v_custom_record shows the names of the types that the team file declared at the last start.
//   - written: the bytes that the store wrote to the disk, by day since 1970.
//   - downlink_bundle: the bundles for a ground station. The bundle that was acknowledged last keeps the have-set of
//     all acknowledged bundles; acknowledged bundles have no file.
//   - own_epoch: the own epochs that this file's history began (own_epochs.h).
//   - history: this agent's own superseded states (actors/storage/history.h), with their typed columns as JSON in
//     `fields`. The view v_history shows the names of the types.
//
// 64-bit unsigned numbers are stored as the signed numbers of the same bits.
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "actors/storage/sqlite_database.h"

namespace moondb {

// The SQLite header contains the mark of a store (application_id) and its version (user_version). A change to a table,
// an index, a view or the meaning of a column must raise the version; docs/COMPATIBILITY.md lists the other steps.
inline constexpr std::int64_t kStoreApplicationId = 0x6D6F6F6E;  // "moon"
inline constexpr int kStoreVersion = 6;
inline constexpr int kOldestStoreVersion = 5;  // Older stores are refused.

// Checks that the file is new, or a store of a version from kOldestStoreVersion on with its tables, indexes and views.
// Additional tables, indexes and views belong to the user and are ignored. Changes nothing. Fails with kRefused for a
// store of another version or the file of another program. Fails with kCorrupt if the header or a statement of the
// schema is damaged; such damage would later make SQLite fail with misleading errors.
Result<void> CheckSchema(Database& database);

// Makes a new file a store, in one transaction. After a crash the file is either new or a complete store. Does nothing
// to a file that is not new.
Result<void> MakeSchema(Database& database);

// Returns whether the file is a store of an older version. Requires: it passes CheckSchema.
Result<bool> IsOfOlderVersion(Database& database);

// Returns "TYPE NAME TABLE SQL" of each table, index and view of an intact store of the version.
Result<std::set<std::string>> IntactStatements(std::int64_t version);

}  // namespace moondb
