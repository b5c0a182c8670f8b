#include "model/client_endpoint.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "model/local_socket.h"
#include "model/private_folder.h"
#include "model/team_id.h"

namespace moondb {
namespace {

// Returns the path in an environment variable; an empty path if the variable is unset or empty.
std::filesystem::path FolderIn(const char* variable) {
  const char* folder = std::getenv(variable);
  return folder == nullptr ? "" : folder;
}

// Returns a folder name such as "moon-4f2a91c0". The start of the team's id distinguishes teams of the same name.
std::string TeamFolder(const AgentOfTeam& agent) {
  const std::string id = TeamIdBytes(agent.team_id);
  return id.empty() ? agent.team : agent.team + "-" + TeamIdStart(id);
}

}  // namespace

std::vector<std::filesystem::path> RunFolders() {
  std::vector<std::filesystem::path> folders;
  const auto add = [&folders](const std::filesystem::path& folder) {
    if (std::find(folders.begin(), folders.end(), folder) == folders.end()) folders.push_back(folder);
  };
  if (const auto folder = FolderIn("MOONDB_RUN_DIR"); !folder.empty()) add(folder);
  if (const auto folder = FolderIn("XDG_RUNTIME_DIR"); !folder.empty()) add(folder / "moondb");
  const std::string user = std::to_string(geteuid());
  add("/tmp/moondb-" + user);
  add("/run/user/" + user + "/moondb");
  return folders;
}

Result<std::string> ClientEndpointIn(const std::filesystem::path& run_folder, const AgentOfTeam& agent) {
  const std::filesystem::path folder = std::filesystem::absolute(run_folder) / TeamFolder(agent);
  const std::string path = (folder / (agent.agent + ".sock")).string();
  if (path.size() > kSocketPathLengthMax) {
    return Fail(ErrorCode::kInvalid, path + ": longer than a socket's path may be (107 characters); " +
                                         "set MOONDB_RUN_DIR to a shorter folder");
  }
  // Refuse a folder in which another user could create a socket with this path.
  if (const Result<void> is_private = CheckPrivateFolder(folder); !is_private) {
    return tl::unexpected(is_private.error());
  }
  return kIpcScheme + path;
}

}  // namespace moondb
