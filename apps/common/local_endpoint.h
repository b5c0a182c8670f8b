// Where an agent of this machine lets its clients in, whatever the environment was in which it was started.
#pragma once

#include <sys/types.h>

#include <string>

#include "model/error.h"
#include "runtime/team/team_config.h"

namespace moondb {

struct LocalEndpoint {
  std::string endpoint;   // ipc://..., where somebody listens; empty: nobody does.
  pid_t pid = 0;          // Of the process that holds the agent's default data folder; 0: nobody.
  bool was_here = false;  // The agent runs or has run on this machine: it has a data folder or a socket here.
  std::string why;        // Nobody listens: why that is, as far as it can be seen.
};

// Looks where the process that holds the agent's data folder (beside the team file) says that it listens, then in each
// of RunFolders(). Folders that others could have put a socket into are passed over. kInvalid where this user's own
// choice is such a folder, or too long a path, and nobody listens elsewhere.
Result<LocalEndpoint> FindLocalEndpoint(const TeamFile& team, const proto::AgentConfig& agent);

}  // namespace moondb
