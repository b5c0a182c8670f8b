// The role assignments that this agent has acted on, oldest first. Durable before anyone acts (docs: terms).
#pragma once

#include "actors/storage/sqlite_database.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr int kRoleHistoryMax = 1000;  // Older ones are forgotten.

// One transaction that survives a power cut. Saving the newest one again changes nothing. Fails as Database does.
Result<void> SaveRoles(Database& database, const proto::RoleAssignment& roles);

Result<proto::LoadRolesReply> LoadRoles(Database& database);

}  // namespace moondb
