// The letters of agents in PyFG files. Rovers are A, B, ... in the order of the team file. L is reserved for the base
// station. Thread-safe.
#pragma once

#include <map>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the team's agent for each letter. The keys are the numbers of the letters in the alphabet (AgentOfLetter in
// model/pyfg.h).
std::map<AgentId, AgentId> AgentsByLetter(const proto::TeamConfig& team);

}  // namespace moondb
