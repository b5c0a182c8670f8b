// The letters of agents in PyFG files: rovers are A, B, ... in the order of the team file, without L, which stands for
// the base station. Plain functions.
#pragma once

#include <map>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// From a letter's place in the alphabet (model/pyfg.h, AgentOfLetter) to the team's agent.
std::map<AgentId, AgentId> AgentsByLetter(const proto::TeamConfig& team);

}  // namespace moondb
