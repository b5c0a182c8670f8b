// Reads the pose graph that an agent holds, and what leaders have published of it.
#pragma once

#include "actors/pgo/known_graph.h"
#include "client/client.h"
#include "proto/team.pb.h"

namespace moondb {

// Without records that do not count, as the agents themselves leave them out (model/record_authority.h). The
// errors of Client::ReadAll, and kCorrupt for a record that does not hold what its type says.
Result<KnownGraph> ReadGraphOf(Client& client, const proto::TeamConfig& team);

}  // namespace moondb
