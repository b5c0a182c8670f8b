// Where agents of this user may let their clients in. Plain functions; ClientEndpoint of runtime/team/team_config.h is
// the first of these places.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "runtime/team/team_config.h"

namespace moondb {

// Folders in which an agent of this user may have put its socket, whose environment was another one; this process's own
// choice first.
std::vector<std::filesystem::path> RunFolders();

// The endpoint in one of these: in a folder of the team's name and the beginning of its id. Errors as of
// ClientEndpoint.
Result<std::string> ClientEndpointIn(const std::filesystem::path& run_folder, const TeamFile& team,
                                     const std::string& agent_name);

}  // namespace moondb
