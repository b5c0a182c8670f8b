// Who is of a team, by its configuration. Plain functions, any thread.
#pragma once

#include <string>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Null where there is none. Those that have left are found too.
const proto::AgentConfig* FindAgent(const proto::TeamConfig& team, AgentId id);
const proto::AgentConfig* FindAgent(const proto::TeamConfig& team, const std::string& name);

// Whether `agent` has left the team: it stands in the file marked `left`. Its records and what it decided remain.
bool HasLeft(const proto::TeamConfig& team, AgentId agent);

AgentId BaseStationOf(const proto::TeamConfig& team);  // 0: none, or it has left.

}  // namespace moondb
