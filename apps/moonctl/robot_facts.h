// Gathers facts about this computer and its network, for Diagnose.
#pragma once

#include <string>

#include "apps/moonctl/diagnosis.h"
#include "runtime/team/team_config.h"

namespace moondb {

// Returns the facts that need no agent: keys, data folder, disk, clock, limits, and the way to each peer. Takes some
// seconds. `data_folder` is that of the agent; empty: the default. `is_running` in the result is true if a process uses
// the data folder. The loss is measured only if this user may open an ICMP socket (root, or net.ipv4.ping_group_range).
RobotFacts GatherFacts(const TeamFile& team, const proto::AgentConfig& agent, const std::string& data_folder);

}  // namespace moondb
