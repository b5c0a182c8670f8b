// Determines which agents have not confirmed a role assignment yet. Thread-safe.
#pragma once

#include "proto/role.pb.h"

namespace moondb {

// Adds to shown.not_confirmed_by the leader and the survivor of shown.roles that are not in shown.confirmed_by. A
// leader that did not issue the term itself is also added.
void AddNotConfirmed(proto::RoleShowReply& shown);

}  // namespace moondb
