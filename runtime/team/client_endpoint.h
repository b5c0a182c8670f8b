// Folders and endpoints of the sockets at which this user's agents accept clients. See also ClientEndpoint in
// runtime/team/team_config.h.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "runtime/team/team_config.h"

namespace moondb {

// Returns the folders in which an agent of this user may have created its socket: first the folder that this process
// would use, then those that agents with other environment variables use.
std::vector<std::filesystem::path> RunFolders();

// Returns the endpoint of an agent's socket in `run_folder`, one of RunFolders(). The socket lies in a subfolder that
// is named after the team's name and the start of its id. Returns kInvalid if the path is too long for a socket or the
// folder fails CheckPrivateFolder.
Result<std::string> ClientEndpointIn(const std::filesystem::path& run_folder, const TeamFile& team,
                                     const std::string& agent_name);

}  // namespace moondb
