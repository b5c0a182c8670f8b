// What people call an agent. Plain function.
#pragma once

#include <string>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// "rover2"; "agent 9" for one that the team does not have, "nobody" for 0.
std::string AgentName(const proto::TeamConfig& team, AgentId agent);

}  // namespace moondb
