// Whose store a database file is: the agent whose records it numbers, and, for people who query it, its team and types.
#pragma once

#include <set>

#include "actors/storage/sqlite_database.h"
#include "model/custom_types.h"
#include "model/ids.h"

namespace moondb {

// kRefused: it is another agent's; two agents that number in one copied file would give two records one name.
// Whether it has an owner already.
Result<bool> CheckOwner(Database& database, AgentId self);

// Makes the store `self`'s and writes its team and types down; only what differs, so that a start on a full disk has
// nothing to write.
Result<void> WriteOwner(Database& database, AgentId self, const std::set<AgentId>& team, const CustomTypes& types);

}  // namespace moondb
