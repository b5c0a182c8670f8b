#include "runtime/transport/tcp_connections.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <optional>
#include <string>
#include <utility>

#include "model/tcp_info.h"

namespace moondb {
namespace {

struct Endpoint {
  std::string address;
  std::uint16_t port = 0;
};

// Converts a socket address. An IPv4-mapped IPv6 address yields the IPv4 address.
std::optional<Endpoint> EndpointOf(const sockaddr_storage& storage) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (storage.ss_family == AF_INET) {
    sockaddr_in v4{};
    std::memcpy(&v4, &storage, sizeof v4);
    ::inet_ntop(AF_INET, &v4.sin_addr, text.data(), text.size());
    return Endpoint{text.data(), ntohs(v4.sin_port)};
  }
  if (storage.ss_family != AF_INET6) return std::nullopt;
  sockaddr_in6 v6{};
  std::memcpy(&v6, &storage, sizeof v6);
  if (IN6_IS_ADDR_V4MAPPED(&v6.sin6_addr)) {
    ::inet_ntop(AF_INET, &v6.sin6_addr.s6_addr[12], text.data(), text.size());
  } else {
    ::inet_ntop(AF_INET6, &v6.sin6_addr, text.data(), text.size());
  }
  return Endpoint{text.data(), ntohs(v6.sin6_port)};
}

template <typename Call>
std::optional<sockaddr_storage> Ask(Call call, int file) {
  sockaddr_storage storage{};
  socklen_t size = sizeof storage;
  if (call(file, reinterpret_cast<sockaddr*>(&storage), &size) != 0) return std::nullopt;
  return storage;
}

}  // namespace

Result<std::unique_ptr<TcpConnections>> TcpConnections::Make(std::set<std::uint16_t> ports) {
  const int epoll = ::epoll_create1(EPOLL_CLOEXEC);
  if (epoll < 0) return Fail(ErrorCode::kUnavailable, std::string("cannot watch connections: ") + std::strerror(errno));
  return std::unique_ptr<TcpConnections>(new TcpConnections(std::move(ports), epoll));
}

TcpConnections::~TcpConnections() { ::close(epoll_); }

void TcpConnections::OnAccepted(int file) {
  accepted_.insert(file);
  known_.erase(file);
}

std::optional<TcpConnection> TcpConnections::Read(int file) {
  known_.erase(file);
  const std::optional<sockaddr_storage> own_address = Ask(::getsockname, file);
  const std::optional<sockaddr_storage> peer_address = Ask(::getpeername, file);
  if (!own_address || !peer_address) return std::nullopt;
  const std::optional<Endpoint> own = EndpointOf(*own_address);
  const std::optional<Endpoint> peer = EndpointOf(*peer_address);
  if (!own || !peer) return std::nullopt;
  // One-shot: epoll reports only the next arrival of data. A descriptor that libzmq closes is removed from epoll
  // automatically.
  epoll_event event{};
  event.events = EPOLLIN | EPOLLET | EPOLLONESHOT;
  event.data.fd = file;
  if (::epoll_ctl(epoll_, EPOLL_CTL_MOD, file, &event) != 0) (void)::epoll_ctl(epoll_, EPOLL_CTL_ADD, file, &event);
  const std::optional<TcpInfo> info = ReadTcpInfo(file);
  if (!info || !info->is_established) return std::nullopt;  // The peer has closed the connection.
  const TcpConnection connection{file, own->port, peer->address, peer->port, info->bytes_received.value_or(0)};
  known_[file] = {*peer_address, connection};
  return connection;
}

std::optional<TcpConnection> TcpConnections::Inspect(int file) {
  const auto known = known_.find(file);
  if (known == known_.end()) return Read(file);
  const std::optional<sockaddr_storage> peer = Ask(::getpeername, file);
  if (peer && std::memcmp(&*peer, &known->second.peer, sizeof *peer) == 0) return known->second.connection;
  return Read(file);
}

std::vector<TcpConnection> TcpConnections::List() {
  Drain();
  std::vector<TcpConnection> connections;
  for (auto file = accepted_.begin(); file != accepted_.end();) {
    std::optional<TcpConnection> connection = Inspect(*file);
    const bool is_here = connection && ports_.contains(connection->port);
    if (is_here) connections.push_back(std::move(*connection));
    file = is_here ? std::next(file) : accepted_.erase(file);
  }
  return connections;
}

std::uint16_t TcpConnections::PeerPortOf(int file) {
  const std::optional<sockaddr_storage> address = Ask(::getpeername, file);
  const std::optional<Endpoint> peer = address ? EndpointOf(*address) : std::nullopt;
  return peer ? peer->port : 0;
}

void TcpConnections::Drain() {
  std::array<epoll_event, 64> events{};
  int count = 0;
  while ((count = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), /*timeout=*/0)) > 0) {
    for (int i = 0; i < count; ++i) known_.erase(events[static_cast<std::size_t>(i)].data.fd);
  }
}

void TcpConnections::ShutDown(const TcpConnection& connection) { (void)::shutdown(connection.file, SHUT_RDWR); }

}  // namespace moondb
