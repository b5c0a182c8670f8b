// Stores the owner of a database file: the agent whose own records get their keys from this file. Also stores the team
// and its custom types, for people who query the file.
#pragma once

#include <set>

#include "actors/storage/sqlite_database.h"
#include "model/custom_types.h"
#include "model/ids.h"

namespace moondb {

// Returns whether the file has an owner. Fails with kRefused if the owner is another agent: two agents that number
// records in copies of one file would give two records the same name.
Result<bool> CheckOwner(Database& database, AgentId self);

// Makes `self` the owner, and stores team and types. Writes nothing if the file already contains the same owner, team
// and types, so a start on a full disk succeeds.
Result<void> WriteOwner(Database& database, AgentId self, const std::set<AgentId>& team, const CustomTypes& types);

}  // namespace moondb
