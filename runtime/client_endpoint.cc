#include <unistd.h>

#include <cstdlib>

#include "runtime/private_folder.h"
#include "runtime/team_config.h"

namespace moondb {
namespace {

constexpr std::size_t kSocketPathLengthMax = 107;  // sockaddr_un, less its final 0.

std::filesystem::path RunFolder() {
  // An empty variable counts as unset.
  if (const char* folder = std::getenv("MOONDB_RUN_DIR"); folder != nullptr && *folder != '\0') return folder;
  if (const char* folder = std::getenv("XDG_RUNTIME_DIR"); folder != nullptr && *folder != '\0') {
    return std::filesystem::path(folder) / "moondb";
  }
  return "/tmp/moondb-" + std::to_string(geteuid());
}

}  // namespace

Result<std::string> ClientEndpoint(const TeamFile& team, const std::string& agent_name) {
  const std::filesystem::path folder = std::filesystem::absolute(RunFolder()) / team.config.team();
  const std::string path = (folder / (agent_name + ".sock")).string();
  if (path.size() > kSocketPathLengthMax) {
    return Fail(ErrorCode::kInvalid, path + ": longer than a socket's path may be (107 characters); " +
                                         "set MOONDB_RUN_DIR to a shorter folder");
  }
  // Another user's socket must not be taken for the agent's.
  if (const Result<void> is_private = CheckPrivateFolder(folder); !is_private) {
    return tl::unexpected(is_private.error());
  }
  return "ipc://" + path;
}

}  // namespace moondb
