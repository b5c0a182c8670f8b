// Determines which agents act on a role assignment, by the knowledge of one agent. Thread-safe.
#pragma once

#include "proto/role.pb.h"

namespace moondb {

// Fills in RoleShowReply.not_confirmed_by: those of the leader and survivor of `shown.roles` that do not act on the
// assignment yet, according to `confirmed_by` and the term. A leader only acts in a term that it has issued itself.
void AddNotConfirmed(proto::RoleShowReply& shown);

}  // namespace moondb
