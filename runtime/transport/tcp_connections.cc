#include "runtime/transport/tcp_connections.h"

#include <arpa/inet.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <utility>

namespace moondb {
namespace {

constexpr std::uint8_t kEstablished = 1;  // TCP_ESTABLISHED of netinet/tcp.h, which does not go with linux/tcp.h.

struct Endpoint {
  std::string address;
  std::uint16_t port = 0;
};

// An IPv4 address that came over an IPv6 socket is the IPv4 address.
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
std::optional<Endpoint> Ask(Call call, int file) {
  sockaddr_storage storage{};
  socklen_t size = sizeof storage;
  if (call(file, reinterpret_cast<sockaddr*>(&storage), &size) != 0) return std::nullopt;
  return EndpointOf(storage);
}

}  // namespace

Result<std::unique_ptr<TcpConnections>> TcpConnections::Watch(std::set<std::uint16_t> ports) {
  const int epoll = ::epoll_create1(EPOLL_CLOEXEC);
  DIR* own_files = epoll < 0 ? nullptr : ::opendir("/proc/self/fd");
  if (own_files == nullptr) {
    const std::string why = std::strerror(errno);
    if (epoll >= 0) ::close(epoll);
    return Fail(ErrorCode::kUnavailable, "cannot watch connections: " + why);
  }
  return std::unique_ptr<TcpConnections>(new TcpConnections(std::move(ports), epoll, own_files));
}

TcpConnections::~TcpConnections() {
  ::closedir(own_files_);
  ::close(epoll_);
}

// The file says once, from here on, that something came; one that libzmq closes leaves epoll by itself.
void TcpConnections::Arm(int file) const {
  epoll_event event{};
  event.events = EPOLLIN | EPOLLET | EPOLLONESHOT;
  if (::epoll_ctl(epoll_, EPOLL_CTL_MOD, file, &event) != 0) (void)::epoll_ctl(epoll_, EPOLL_CTL_ADD, file, &event);
}

// Files that listen are armed before the others are looked at: who connects meanwhile is seen here or announced.
std::vector<TcpConnection> TcpConnections::List() {
  const std::set<int> armed = std::exchange(listeners_, {});
  for (const int listener : armed) Arm(listener);
  std::vector<TcpConnection> connections;
  ::rewinddir(own_files_);
  while (const dirent* entry = ::readdir(own_files_)) {
    if (entry->d_name[0] == '.') continue;
    const int file = std::atoi(entry->d_name);
    const std::optional<Endpoint> own = Ask(::getsockname, file);
    if (!own || !ports_.contains(own->port)) continue;
    int listens = 0;
    socklen_t listens_size = sizeof listens;
    (void)::getsockopt(file, SOL_SOCKET, SO_ACCEPTCONN, &listens, &listens_size);
    if (listens != 0) {
      listeners_.insert(file);
      if (!armed.contains(file)) Arm(file);
      continue;
    }
    Arm(file);
    const std::optional<Endpoint> peer = Ask(::getpeername, file);
    tcp_info info{};
    socklen_t size = sizeof info;
    if (!peer || ::getsockopt(file, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) continue;
    if (info.tcpi_state != kEstablished) continue;  // Its peer has left, which libzmq is about to notice.
    connections.push_back({file, own->port, peer->address, peer->port, 0});
    if (size >= offsetof(tcp_info, tcpi_bytes_received) + sizeof info.tcpi_bytes_received) {
      connections.back().bytes_received = info.tcpi_bytes_received;
    }
  }
  return connections;
}

std::uint16_t TcpConnections::PeerPortOf(int file) {
  const std::optional<Endpoint> peer = Ask(::getpeername, file);
  return peer ? peer->port : 0;
}

void TcpConnections::Drain() {
  std::array<epoll_event, 64> events{};
  while (::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), /*timeout=*/0) > 0) {
  }
}

void TcpConnections::ShutDown(const TcpConnection& connection) { (void)::shutdown(connection.file, SHUT_RDWR); }

}  // namespace moondb
