// Reads an agent's pose graph and the results that leaders published: map matches, optimized poses, and verdicts.
#pragma once

#include <functional>

#include "actors/pgo/known_graph.h"
#include "client/client.h"
#include "proto/team.pb.h"

namespace moondb {

// Reads the graph from the agent that `client` is connected to. Leaves out the records that agents ignore because the
// author had no authority for them (model/record_authority.h). Returns the errors of Client::ReadAll, and kCorrupt for
// a record whose content does not fit its type. Calls `added` for each record that was added to the graph.
Result<KnownGraph> ReadGraphOf(Client& client, const proto::TeamConfig& team,
                               const std::function<void(const RecordKey&, const proto::Record&)>& added = {});

}  // namespace moondb
