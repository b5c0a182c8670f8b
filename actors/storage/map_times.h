// Reads the times of the local maps that an agent holds of each origin (proto::StorageStatus.map_times). Not
// thread-safe.
#pragma once

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/status.pb.h"

namespace moondb {

// Adds map_times to `status`. Reads two rows an origin. Errors are those of Database.
Result<void> AddMapTimes(Database& database, const HaveSet& have, proto::StorageStatus& status);

}  // namespace moondb
