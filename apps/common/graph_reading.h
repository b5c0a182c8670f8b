// Reads the pose graph that an agent holds, and what leaders have published of it.
#pragma once

#include "actors/pgo/known_graph.h"
#include "client/client.h"

namespace moondb {

// The errors of Client::ReadAll, and kCorrupt for a record that does not hold what its type says.
Result<KnownGraph> ReadGraphOf(Client& client);

}  // namespace moondb
