// Migrates stores of older versions (docs/COMPATIBILITY.md).
#pragma once

#include "actors/storage/sqlite_database.h"
#include "model/error.h"
#include "model/ids.h"

namespace moondb {

// Makes a store of an older version one of this version, in one transaction that keeps all rows. After a crash the file
// is a store of either version. Does nothing to a new file and to a store of this version. Indexes and triggers of the
// user's own stay.
//
// If the disk has room, first copies the file to PATH.before-version-6, which is the only way back. A copy that an
// interrupted migration made stays.
//
// Requires: the file passes CheckSchema. Fails with kRefused if the file belongs to another agent than `self`. Other
// errors are those of Database. After an error the store is unchanged.
Result<void> MigrateStore(Database& database, AgentId self);

}  // namespace moondb
