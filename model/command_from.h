// Whose relayed commands agents obey, and whose word on roles is an operator's: `command_from` of the team file. Plain
// functions, any thread.
#pragma once

#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

inline constexpr char kAllMayCommand[] = "all";  // In place of names.

// Where the file names nobody, the base station may, or every agent in a team without one. False for who is not of the
// team, or has left it.
bool MayCommand(const proto::TeamConfig& team, AgentId agent);

}  // namespace moondb
