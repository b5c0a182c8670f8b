// FactsOf: what the solver gets to know of each agent, from the team's configuration or a mission's folder.
#pragma once

#include "actors/pgo/graph_check.h"
#include "model/mission.h"
#include "proto/team.pb.h"

namespace moondb {

// A rover without `start`, or a base station without `position_m`, gets no start pose. `team` has been checked.
AgentFactsMap FactsOf(const proto::TeamConfig& team);

AgentFactsMap FactsOf(const Mission& mission);

}  // namespace moondb
