// The role assignments that this agent has acted on, and what they follow, oldest first. Durable before anyone acts
// (docs: terms).
#pragma once

#include <vector>

#include "actors/storage/sqlite_database.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr int kRoleHistoryMax = 16384;  // Older ones are forgotten.

// Inside the caller's transaction. False for the newest one once more, which changes nothing. Fails as Database does.
Result<bool> AddRoles(Database& database, const proto::RoleAssignment& roles);

Result<proto::LoadRolesReply> LoadRoles(Database& database);

// Those that are held as records, oldest first.
Result<std::vector<proto::RoleAssignment>> LoadRoleRecords(Database& database);

}  // namespace moondb
