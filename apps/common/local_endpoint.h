// Finds the client endpoint of an agent on this machine, whatever environment variables the agent was started with.
#pragma once

#include <sys/types.h>

#include <string>

#include "model/error.h"
#include "runtime/team/team_config.h"

namespace moondb {

struct LocalEndpoint {
  std::string endpoint;   // The endpoint (ipc://...) at which a process listens. Empty: no process listens.
  pid_t pid = 0;          // The process that holds the agent's default data folder. 0: no process.
  bool was_here = false;  // The agent runs or has run on this machine: it has a data folder or a socket here.
  std::string why;        // The reason why no process listens. Empty if it is not known.
};

// Tries the endpoint that the agent's process wrote to its data folder, then the agent's socket in each of
// RunFolders(). Skips folders to which other users can write. Returns kInvalid if no process listens and the first of
// RunFolders() cannot be used, because other users can write to it or its path is too long.
Result<LocalEndpoint> FindLocalEndpoint(const TeamFile& team, const proto::AgentConfig& agent);

}  // namespace moondb
