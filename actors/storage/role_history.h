// Stores the role assignments that this agent has acted on, and their predecessors, oldest first. An assignment is
// durable before any actor acts on it.
#pragma once

#include <vector>

#include "actors/storage/sqlite_database.h"
#include "proto/storage.pb.h"

namespace moondb {

// Maximum number of stored assignments. Older assignments are deleted.
inline constexpr int kRoleHistoryMax = 16384;

// Adds an assignment, inside the caller's transaction. Returns false, and changes nothing, if `roles` equals the newest
// assignment. Fails as Database does.
Result<bool> AddRoles(Database& database, const proto::RoleAssignment& roles);

Result<proto::LoadRolesReply> LoadRoles(Database& database);

// Returns the assignments that are held as records, oldest first.
Result<std::vector<proto::RoleAssignment>> LoadRoleRecords(Database& database);

}  // namespace moondb
