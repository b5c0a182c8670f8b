#include "apps/common/local_endpoint.h"

#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

#include "apps/common/data_folder.h"
#include "client/endpoint.h"

namespace moondb {
namespace {

// Explains why no client can connect although process `pid` runs the agent. `endpoint` is the content of the agent's
// `agent.endpoint`; nothing listens there. Empty: the process has not written the file.
std::string WhyNot(const std::string& agent, pid_t pid, const std::string& endpoint) {
  const std::string runs = "agent " + agent + " runs as process " + std::to_string(pid);
  struct stat process {};
  const bool is_anothers = ::geteuid() != 0 && ::stat(("/proc/" + std::to_string(pid)).c_str(), &process) == 0 &&
                           process.st_uid != ::geteuid();
  if (is_anothers) {
    const passwd* user = ::getpwuid(process.st_uid);
    return runs + " of the user " + (user == nullptr ? std::to_string(process.st_uid) : user->pw_name) +
           ", and this user cannot use its socket: run moonctl as that user, or with --key";
  }
  if (endpoint.empty())
    return runs + ", but has not written the path of its socket to agent.endpoint; check that its disk is not full";
  return runs + ", but its socket " + endpoint.substr(std::min(std::strlen(kIpcScheme), endpoint.size())) +
         " is missing; the agent recreates the socket within seconds; if it does not, restart the agent";
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
  const Result<EndpointSearch> search = SearchEndpoint(AgentOf(team, agent.name()), reported);
  if (!search) return tl::unexpected(search.error());
  found.endpoint = search->endpoint;
  found.was_here = found.was_here || search->has_socket;
  if (found.endpoint.empty()) found.why = found.pid != 0 ? WhyNot(agent.name(), found.pid, reported) : search->why;
  return found;
}

}  // namespace moondb
