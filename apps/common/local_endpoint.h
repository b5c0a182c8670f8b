// Finds the client endpoint of an agent on this machine, independent of the environment in which the agent was started.
#pragma once

#include <sys/types.h>

#include <string>

#include "model/error.h"
#include "runtime/team/team_config.h"

namespace moondb {

struct LocalEndpoint {
  std::string endpoint;   // ipc://... with a listener. Empty: no process listens.
  pid_t pid = 0;          // The process that holds the agent's default data folder. 0: none.
  bool was_here = false;  // The agent runs or has run on this machine: it has a data folder or a socket here.
  std::string why;        // The reason why no process listens, as far as it is known.
};

// Tries the endpoint that the owner of the agent's data folder (beside the team file) reported, then the socket in each
// of RunFolders(). Skips folders in which other users could have placed a socket. kInvalid if no process listens and
// the folder that this user chose is such a folder or has too long a path.
Result<LocalEndpoint> FindLocalEndpoint(const TeamFile& team, const proto::AgentConfig& agent);

}  // namespace moondb
