// Determines which agents have not confirmed a role assignment yet. Thread-safe.
#pragma once

#include "proto/role.pb.h"

namespace moondb {

// Adds the leader and the survivor of shown.roles to shown.not_confirmed_by, each unless shown.confirmed_by contains
// it. Also adds a leader that did not issue the term itself.
void AddNotConfirmed(proto::RoleShowReply& shown);

}  // namespace moondb
