// Looks up the members of a team in its configuration. Thread-safe.
#pragma once

#include <string>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Return the agent with this id or name, even if it has left the team. Null if there is none.
const proto::AgentConfig* FindAgent(const proto::TeamConfig& team, AgentId id);
const proto::AgentConfig* FindAgent(const proto::TeamConfig& team, const std::string& name);

// Returns the endpoint that the agent listens on: `listen`, or `address` if that is not set.
const std::string& ListenAddressOf(const proto::AgentConfig& agent);

// Returns whether the team file marks the agent with `left`. The records and decisions of such an agent stay valid.
bool HasLeft(const proto::TeamConfig& team, AgentId agent);

AgentId BaseStationOf(
    const proto::TeamConfig& team);  // Returns 0 if the team has no base station, or its base station has left.

}  // namespace moondb
