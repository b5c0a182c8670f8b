// Who acts on an assignment of roles, as an agent knows it. Plain function, any thread.
#pragma once

#include "proto/role.pb.h"

namespace moondb {

// Fills in RoleShowReply.not_confirmed_by: of the leader and survivor of `shown.roles`, those that do not act on it yet
// as far as `confirmed_by` and the term say. A leader acts in terms of its own alone.
void AddNotConfirmed(proto::RoleShowReply& shown);

}  // namespace moondb
