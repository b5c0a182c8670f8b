// FactsOf: extracts the solver's input about each agent from the team's configuration or from a mission folder.
#pragma once

#include "actors/pgo/graph_check.h"
#include "model/mission.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the facts of each agent. A rover without a `start` that counts (KnownStarts), or a base station without
// `position_m`, gets no start pose.
// Requires: `team` is validated.
AgentFactsMap FactsOf(const proto::TeamConfig& team);

AgentFactsMap FactsOf(const Mission& mission);

}  // namespace moondb
