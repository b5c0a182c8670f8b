// Folders and endpoints of the sockets at which this user's agents accept clients. Not thread-safe: reads environment
// variables.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

inline constexpr char kIpcScheme[] = "ipc://";

// An agent of a team, as the team file names them.
struct AgentOfTeam {
  std::string team;
  std::string team_id;  // 32 hexadecimal digits.
  std::string agent;
};

// Returns the folders in which an agent of this user may have created its socket. The first one is the folder that this
// process would use: $MOONDB_RUN_DIR, $XDG_RUNTIME_DIR/moondb or /tmp/moondb-UID. Agents with other environment
// variables use the others.
std::vector<std::filesystem::path> RunFolders();

// Returns the endpoint (ipc://...) of an agent's socket in `run_folder`, one of RunFolders(). The socket lies in a
// subfolder that is named after the team's name and the start of its id. Returns kInvalid if the path is too long for a
// socket or the subfolder fails CheckPrivateFolder.
Result<std::string> ClientEndpointIn(const std::filesystem::path& run_folder, const AgentOfTeam& agent);

}  // namespace moondb
