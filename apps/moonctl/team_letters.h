// The letters of agents in PyFG and g2o files. Rovers are A, B, ... in the order of the team file. L is reserved for
// the base station. Thread-safe.
#pragma once

#include <map>
#include <string>

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the team's agent for each letter. The keys are the numbers of the letters in the alphabet (AgentOfLetter in
// model/pyfg.h).
std::map<AgentId, AgentId> AgentsByLetter(const proto::TeamConfig& team);

// Like AgentsByLetter, for files that other programs wrote: a rover's small letter stands for the rover, too, unless
// the team is so large that small letters have agents of their own.
std::map<AgentId, AgentId> AgentsByLetterOfAnyCase(const proto::TeamConfig& team);

// Returns "A is rover1, B is rover2, L is base", with at most 12 agents.
std::string LettersText(const proto::TeamConfig& team);

}  // namespace moondb
