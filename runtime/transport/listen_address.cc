#include "runtime/transport/listen_address.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <memory>
#include <string_view>
#include <system_error>

#include "model/local_socket.h"

namespace moondb {
namespace {

constexpr std::string_view kTcp = "tcp://";

}  // namespace

Result<void> ClaimIpcPath(const std::string& endpoint) {
  const std::string path = SocketFileOf(endpoint);
  if (path.empty()) return {};
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0) {
    if (errno == ENOENT) return {};
    return Fail(ErrorCode::kUnavailable, "cannot listen on " + endpoint + ": " + std::strerror(errno));
  }
  if (!S_ISSOCK(status.st_mode)) return Fail(ErrorCode::kInvalid, path + ": is there already and is not a socket");
  switch (const int error = ProbeLocalSocket(path)) {
    case ENOENT:
      return {};
    case ECONNREFUSED:
      (void)unlink(path.c_str());  // A killed process left this socket file.
      return {};
    case 0:
      return Fail(ErrorCode::kUnavailable, "cannot listen on " + endpoint + ": Address already in use");
    default:
      return Fail(ErrorCode::kUnavailable, "cannot listen on " + endpoint + ": " + std::strerror(error));
  }
}

Result<std::string> NumericEndpoint(const std::string& endpoint) {
  if (!endpoint.starts_with("tcp://")) return endpoint;
  const std::size_t colon = endpoint.rfind(':');
  const std::string host = endpoint.substr(6, colon - 6);
  if (host.starts_with("[")) return endpoint;
  addrinfo hints{};
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), nullptr, &hints, &found); error != 0) {
    return Fail(ErrorCode::kUnavailable, "cannot listen on " + endpoint + ": " + gai_strerror(error));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, freeaddrinfo);
  std::array<char, INET_ADDRSTRLEN> text{};
  const auto* address = reinterpret_cast<const sockaddr_in*>(found->ai_addr);
  inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size());
  return "tcp://" + std::string(text.data()) + endpoint.substr(colon);
}

std::optional<std::uint16_t> TcpPortOf(const std::string& endpoint) {
  if (!endpoint.starts_with(kTcp)) return std::nullopt;
  const char* begin = endpoint.data() + endpoint.rfind(':') + 1;
  const char* end = endpoint.data() + endpoint.size();
  std::uint16_t port = 0;
  const auto [rest, error] = std::from_chars(begin, end, port);
  return error == std::errc() && rest == end ? std::optional(port) : std::nullopt;
}

std::string NumericAddressOf(const std::string& endpoint) {
  if (!endpoint.starts_with(kTcp)) return "";
  std::string host = endpoint.substr(kTcp.size(), endpoint.rfind(':') - kTcp.size());
  if (host == "localhost") return "127.0.0.1";
  if (host.starts_with("[") && host.ends_with("]")) host = host.substr(1, host.size() - 2);
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  std::array<char, INET6_ADDRSTRLEN> text{};
  for (const int family : {AF_INET, AF_INET6}) {
    if (inet_pton(family, host.c_str(), bytes.data()) != 1) continue;
    return inet_ntop(family, bytes.data(), text.data(), text.size());  // Returns the system's canonical form.
  }
  return "";
}

std::string SocketFileOf(const std::string& endpoint) {
  constexpr std::string_view kIpc = "ipc://";
  return endpoint.starts_with(kIpc) ? endpoint.substr(kIpc.size()) : std::string();
}

}  // namespace moondb
