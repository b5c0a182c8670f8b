// The tables and views of an agent's store, and which files are stores that this program opens.
//
// One table per data type (paper, Table 1): typed columns for SQL, derived from `content`, which alone is kept for
// ever and travels. row_id is one sequence over all of these tables, rising in the order of storing. epoch and seq are
// NULL for a row that was not marked for sharing. have_interval says which seqs are held and which are dropped; its
// hashes, and those of role_history, tell a damaged row.
// The views `replica` and `replication_log` are the paper's tables (Section 4), for people: the have-set decides.
// All custom data types (proto/team.proto) share the table custom_record, whose payload is a part of `content`; the
// view v_custom_record shows them by name, as far as the team file of the last start names them. 64-bit unsigned
// numbers stand as the signed ones of the same bits. `written` counts what the store wrote to the disk, by day since
// 1970. downlink_bundle keeps bundles for the ground; one that was acknowledged keeps its have-set, not its file.
// own_epoch says which epochs of the own agent this file's history began (own_epochs.h).
// `history` keeps this agent's own superseded states (actors/storage/history.h), with their typed columns as JSON in
// `fields`; the view v_history shows them by name.
#pragma once

#include <cstdint>

#include "actors/storage/sqlite_database.h"

namespace moondb {

// A store says in SQLite's header that it is one (application_id) and of which version (user_version). Whoever changes
// a table, an index, a view or what a column means raises the version, and docs/COMPATIBILITY.md says what else.
inline constexpr std::int64_t kStoreApplicationId = 0x6D6F6F6E;  // "moon"
inline constexpr int kStoreVersion = 3;

// Whether the file is new, or a store of this version with its tables, indexes and views; others beside them are the
// user's own. Changes nothing. kRefused: a store of another version, or another program's. kCorrupt: a damaged
// statement of the schema, which would make SQLite fail in ways that look like something else, or a damaged header.
Result<void> CheckSchema(Database& database);

// Makes a new file a store, in one transaction, so that a crash leaves it new or whole. Any other file stays as it is.
Result<void> MakeSchema(Database& database);

}  // namespace moondb
