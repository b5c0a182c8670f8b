// Folders and endpoints of the sockets at which agents of this user accept clients. ClientEndpoint in
// runtime/team/team_config.h returns the first of these endpoints.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "runtime/team/team_config.h"

namespace moondb {

// Returns the folders in which an agent of this user may have created its socket, this process's own choice first. The
// other folders serve agents that run with different environment variables.
std::vector<std::filesystem::path> RunFolders();

// Returns the endpoint in one of these folders: in a subfolder with the team's name and the start of its id. Errors as
// for ClientEndpoint.
Result<std::string> ClientEndpointIn(const std::filesystem::path& run_folder, const TeamFile& team,
                                     const std::string& agent_name);

}  // namespace moondb
