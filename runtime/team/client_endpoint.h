// Folders and endpoints of the sockets at which agents of this user accept clients. ClientEndpoint in
// runtime/team/team_config.h returns the first of these endpoints.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "runtime/team/team_config.h"

namespace moondb {

// Returns the folders in which an agent of this user may have created its socket. The first one is the folder that this
// process itself would use. Agents that run with other environment variables use the others.
std::vector<std::filesystem::path> RunFolders();

// Returns the endpoint of an agent's socket in `run_folder`, one of RunFolders(). The socket lies in a subfolder that
// is named after the team's name and the start of its id. Errors as for ClientEndpoint.
Result<std::string> ClientEndpointIn(const std::filesystem::path& run_folder, const TeamFile& team,
                                     const std::string& agent_name);

}  // namespace moondb
