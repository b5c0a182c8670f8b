// Display names of agents.
#pragma once

#include <string>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the agent's name in the team file: "rover2". Returns "agent 9" for an unknown agent, and "nobody" for 0.
std::string AgentName(const proto::TeamConfig& team, AgentId agent);

}  // namespace moondb
