// The owner of a database file, which is the agent that numbers its records. For people who query the file, its team
// and its custom types are stored too.
#pragma once

#include <set>

#include "actors/storage/sqlite_database.h"
#include "model/custom_types.h"
#include "model/ids.h"

namespace moondb {

// Returns whether the file has an owner. kRefused if the owner is another agent: two agents that number records in
// copies of one file would give two records the same name.
Result<bool> CheckOwner(Database& database, AgentId self);

// Makes `self` the owner and stores team and types. Writes nothing if all of this is stored already, so a start on a
// full disk succeeds.
Result<void> WriteOwner(Database& database, AgentId self, const std::set<AgentId>& team, const CustomTypes& types);

}  // namespace moondb
