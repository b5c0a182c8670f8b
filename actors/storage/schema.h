// The tables and views of an agent's database, and how an older file becomes today's.
//
// One table per data type (paper, Table 1): typed columns for SQL, derived from `content`, which alone is kept for
// ever and travels. row_id is one sequence over all of these tables, rising in the order of storing. epoch and seq are
// NULL for a row that was not marked for sharing. have_interval says which seqs are held and which are dropped; its
// hashes, and those of role_history, tell a damaged row (NULL: as an older version wrote it).
// The views `replica` and `replication_log` are the paper's tables (Section 4), for people: the have-set decides.
// All custom data types (proto/team.proto) share the table custom_record, whose payload is a part of `content`; the
// view v_custom_record shows them by name, as far as the team file of the last start names them. 64-bit unsigned
// numbers stand as the signed ones of the same bits. `written` counts what the store wrote to the disk, by day since
// 1970. downlink_bundle keeps bundles for the ground; one that was acknowledged keeps its have-set, not its file.
// own_epoch says which epochs of the own agent this file's history began (own_epochs.h).
// `history` keeps this agent's own superseded states (actors/storage/history.h), with their typed columns as JSON in
// `fields`; the view v_history shows them by name.
#pragma once

#include "actors/storage/sqlite_database.h"

namespace moondb {

// The newest version. A data type's table comes with the version that its row names (actors/storage/type_tables.h). Any
// other change of tables or views is a version with a step of its own; steps that were ever released stay as they are.
int SchemaVersion();

// Whether tables, indexes and views are still those of the file's version; others beside them are the user's own.
// kCorrupt where not: a damaged statement of the schema would make SQLite fail in ways that look like something else.
// A file that Migrate refuses passes.
Result<void> CheckSchema(Database& database);

// Brings the file to version `to` in one transaction, so that a crash leaves it old or new. kRefused for a newer file
// or one that is another program's. Only tests have cause for another version than the newest.
Result<void> Migrate(Database& database, int to = SchemaVersion());

}  // namespace moondb
