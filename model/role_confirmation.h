// Determines which agents act on a role assignment, as far as the answering agent knows. Thread-safe.
#pragma once

#include "proto/role.pb.h"

namespace moondb {

// Adds the leader and the survivor of `shown.roles` to RoleShowReply.not_confirmed_by, unless they act on the
// assignment already. An agent acts on it if `confirmed_by` contains the agent. The leader must also have issued the
// term itself.
void AddNotConfirmed(proto::RoleShowReply& shown);

}  // namespace moondb
