#include "apps/common/local_endpoint.h"

#include <cerrno>
#include <cstring>
#include <optional>

#include "apps/common/data_folder.h"
#include "model/local_socket.h"
#include "runtime/team/client_endpoint.h"
#include "runtime/team/private_folder.h"

namespace moondb {
namespace {

constexpr std::string_view kIpc = "ipc://";

std::string WhyNot(const std::string& agent, const std::string& path, int error) {
  if (error == ENOENT) return "agent " + agent + " is not running (no socket " + path + ")";
  if (error == ECONNREFUSED) return "agent " + agent + " is not running (nobody listens at " + path + ")";
  return "agent " + agent + ": " + path + ": " + std::strerror(error);
}

// Explains why no client can connect although process `pid` runs the agent. `endpoint` is the content of the agent's
// `agent.endpoint`; nothing listens there. Empty: the process has not written the file.
std::string WhyNot(const std::string& agent, pid_t pid, const std::string& endpoint) {
  const std::string runs = "agent " + agent + " runs as process " + std::to_string(pid);
  if (endpoint.empty()) return runs + ", but has not said where its socket is; is its disk full?";
  return runs + ", but its socket " + endpoint.substr(std::min(kIpc.size(), endpoint.size())) +
         " is gone; the agent recreates it within seconds if it can; otherwise restart the agent";
}

bool IsSafe(const std::string& endpoint) {
  if (!endpoint.starts_with(kIpc)) return false;
  return CheckPrivateFolder(std::filesystem::path(endpoint.substr(kIpc.size())).parent_path()).has_value();
}

}  // namespace

Result<LocalEndpoint> FindLocalEndpoint(const TeamFile& team, const proto::AgentConfig& agent) {
  LocalEndpoint found;
  std::string reported;  // Content of `agent.endpoint`. Empty: no process owns the folder.
  if (const auto folder = FindDataFolder(DefaultDataRoot(team.folder), team.config, agent)) {
    std::error_code error;
    found.was_here = std::filesystem::exists(*folder / kDatabaseFile, error);
    found.pid = OwnerOf(*folder);
    if (found.pid != 0) reported = ReadEndpoint(*folder);
  }
  const auto try_at = [&found](const std::string& endpoint) {
    const int error = ProbeLocalSocket(endpoint.substr(kIpc.size()));
    if (error == 0) found.endpoint = endpoint;
    found.was_here = found.was_here || error != ENOENT;
    return error;
  };
  if (IsSafe(reported) && try_at(reported) == 0) return found;
  std::optional<Error> first_error;
  int worst = 0;
  const auto folders = RunFolders();
  for (const std::filesystem::path& folder : folders) {
    const auto endpoint = ClientEndpointIn(folder, team, agent.name());
    if (!endpoint) {
      if (folder == folders.front()) first_error = endpoint.error();
      continue;
    }
    const int error = try_at(*endpoint);
    if (error == 0) return found;
    if (worst != 0 && error == ENOENT) continue;  // An error of an existing socket explains more than a missing socket.
    worst = error;
    found.why = WhyNot(agent.name(), endpoint->substr(kIpc.size()), error);
  }
  if (first_error) return tl::unexpected(*first_error);
  if (found.pid != 0) found.why = WhyNot(agent.name(), found.pid, reported);
  return found;
}

}  // namespace moondb
