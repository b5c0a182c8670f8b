// Finds the client endpoint of an agent on this machine, independent of the environment in which the agent was started.
#pragma once

#include <sys/types.h>

#include <string>

#include "model/error.h"
#include "runtime/team/team_config.h"

namespace moondb {

struct LocalEndpoint {
  std::string endpoint;   // The endpoint (ipc://...) at which a process listens. Empty: none.
  pid_t pid = 0;          // The process that holds the agent's default data folder. 0: none.
  bool was_here = false;  // The agent runs or has run on this machine: it has a data folder or a socket here.
  std::string why;        // The reason why no process listens. Empty if it is not known.
};

// Tries the endpoint in the agent's data folder (beside the team file), then the socket in each of RunFolders(). Skips
// folders in which other users could have placed a socket. kInvalid if no process listens, and other users can write to
// the first of RunFolders() or its path is too long.
Result<LocalEndpoint> FindLocalEndpoint(const TeamFile& team, const proto::AgentConfig& agent);

}  // namespace moondb
