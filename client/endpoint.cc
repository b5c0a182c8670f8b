#include "client/endpoint.h"

#include <cerrno>
#include <cstring>
#include <optional>

#include "model/local_socket.h"
#include "model/private_folder.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr std::size_t kEndpointBytesMax = 4096;

std::string PathOf(const std::string& endpoint) { return endpoint.substr(std::strlen(kIpcScheme)); }

bool IsSafe(const std::string& endpoint) {
  return endpoint.starts_with(kIpcScheme) &&
         CheckPrivateFolder(std::filesystem::path(PathOf(endpoint)).parent_path()).has_value();
}

std::string WhyNot(const std::string& agent, const std::string& path, int error) {
  if (error == ENOENT) return "agent " + agent + " is not running (no socket " + path + ")";
  if (error == ECONNREFUSED) return "agent " + agent + " is not running (no process listens at " + path + ")";
  return "agent " + agent + ": " + path + ": " + std::strerror(error);
}

}  // namespace

std::string ReadEndpoint(const std::filesystem::path& data_folder) {
  const auto text = ReadTextFile(data_folder / kEndpointFile, kEndpointBytesMax);
  if (!text) return "";
  std::string_view rest = *text;
  return std::string(TakeLine(rest));
}

Result<EndpointSearch> SearchEndpoint(const AgentOfTeam& agent, const std::string& reported) {
  EndpointSearch search;
  const auto try_at = [&search](const std::string& endpoint) {
    const int error = ProbeLocalSocket(PathOf(endpoint));
    if (error == 0) search.endpoint = endpoint;
    search.has_socket = search.has_socket || error != ENOENT;
    return error;
  };
  if (IsSafe(reported) && try_at(reported) == 0) return search;
  std::optional<Error> first_error;
  int worst = 0;
  const auto folders = RunFolders();
  for (const std::filesystem::path& folder : folders) {
    const auto endpoint = ClientEndpointIn(folder, agent);
    if (!endpoint) {
      if (folder == folders.front()) first_error = endpoint.error();
      continue;
    }
    const int error = try_at(*endpoint);
    if (error == 0) return search;
    if (worst != 0 && error == ENOENT) continue;  // An error of an existing socket explains more than a missing socket.
    worst = error;
    search.why = WhyNot(agent.agent, PathOf(*endpoint), error);
  }
  if (first_error) return tl::unexpected(*first_error);
  return search;
}

Result<std::string> FindEndpoint(const AgentOfTeam& agent, const std::filesystem::path& data_folder) {
  const auto search = SearchEndpoint(agent, data_folder.empty() ? "" : ReadEndpoint(data_folder));
  if (!search) return tl::unexpected(search.error());
  if (search->endpoint.empty()) return Fail(ErrorCode::kUnavailable, search->why);
  return search->endpoint;
}

}  // namespace moondb
