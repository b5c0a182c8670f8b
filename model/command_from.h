// Evaluates `command_from` of the team file, which lists the agents through which operators may command other agents
// and decide roles. Thread-safe.
#pragma once

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

inline constexpr char kAllMayCommand[] = "all";  // Entry of command_from that stands for all agents.

// Returns whether operators may give commands through this agent. If command_from is empty, only the base station
// qualifies; in a team without a base station, every agent does. Returns false for an agent that is unknown or has left
// the team.
bool MayCommand(const proto::TeamConfig& team, AgentId agent);

}  // namespace moondb
