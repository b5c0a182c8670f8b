#include "runtime/transport/local_connections.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <algorithm>
#include <cstring>
#include <tuple>
#include <utility>
#include <vector>

namespace moondb {
namespace {

std::uint64_t SocketOf(int file) {
  struct stat status {};
  return ::fstat(file, &status) == 0 ? status.st_ino : 0;
}

std::optional<LocalConnections::Peer> PeerOf(int file, const std::string& path) {
  sockaddr_un own{};
  socklen_t size = sizeof own;
  if (::getsockname(file, reinterpret_cast<sockaddr*>(&own), &size) != 0) return std::nullopt;
  const std::size_t path_bytes = ::strnlen(own.sun_path, sizeof own.sun_path);
  if (own.sun_family != AF_UNIX || path != std::string(own.sun_path, path_bytes)) return std::nullopt;
  ucred credentials{};
  socklen_t credentials_size = sizeof credentials;
  if (::getsockopt(file, SOL_SOCKET, SO_PEERCRED, &credentials, &credentials_size) != 0) return std::nullopt;
  return LocalConnections::Peer{SocketOf(file), credentials.pid};
}

}  // namespace

LocalConnections::System LocalConnections::SystemFor(const std::string& path) {
  return {.peer_of = [path](int file) { return PeerOf(file, path); },
          .socket_of = SocketOf,
          .shut_down = [](int file) { (void)::shutdown(file, SHUT_RDWR); }};
}

std::size_t LocalConnections::LimitFor(std::uint64_t files_max) {
  return static_cast<std::size_t>(std::clamp<std::uint64_t>(files_max / 4, 1, kConnectionsMax));
}

void LocalConnections::OnAccepted(int file, Time now) { (void)Refresh(file, now); }

void LocalConnections::OnRequest(int file, const std::string& route, Time now) {
  Connection* connection = Refresh(file, now);
  if (connection == nullptr) return;
  if (connection->route != route) {
    file_of_route_.erase(connection->route);
    connection->route = route;
    file_of_route_[route] = file;
  }
  connection->active_at = now;
  ++connection->unanswered;
}

void LocalConnections::OnReply(const std::string& route) {
  const auto found = file_of_route_.find(route);
  const auto connection = found == file_of_route_.end() ? connections_.end() : connections_.find(found->second);
  if (connection != connections_.end() && connection->second.unanswered > 0) --connection->second.unanswered;
}

LocalConnections::Connection* LocalConnections::Refresh(int file, Time now) {
  const std::optional<Peer> peer = system_.peer_of(file);
  const auto known = connections_.find(file);
  if (known != connections_.end()) {
    if (peer && known->second.peer.socket == peer->socket) return &known->second;
    Erase(known);
  }
  if (!peer) return nullptr;
  Connection& connection = connections_[file];
  connection.peer = *peer;
  connection.active_at = now;
  connection.number = ++last_number_;
  return &connection;
}

void LocalConnections::Erase(std::map<int, Connection>::iterator entry) {
  const auto route = file_of_route_.find(entry->second.route);
  // A client that chooses its routing id has the same one over its next connection.
  if (route != file_of_route_.end() && route->second == entry->first) file_of_route_.erase(route);
  connections_.erase(entry);
}

void LocalConnections::EraseClosed() {
  for (auto entry = connections_.begin(); entry != connections_.end();) {
    const auto current = entry++;
    if (system_.socket_of(current->first) != current->second.peer.socket) Erase(current);
  }
}

std::size_t LocalConnections::CutExcess(Time now) {
  const std::size_t kept = connections_max_ + connections_max_ / 8;
  const auto is_open = [](const auto& entry) { return !entry.second.is_cut; };
  if (connections_.size() <= kept || std::ranges::count_if(connections_, is_open) <= static_cast<std::ptrdiff_t>(kept))
    return 0;
  EraseClosed();
  std::map<int, std::size_t> of_process;
  std::vector<std::pair<int, Connection*>> open;
  for (auto& [file, connection] : connections_) {
    if (connection.is_cut) continue;  // libzmq closes it soon.
    ++of_process[connection.peer.process];
    open.emplace_back(file, &connection);
  }
  if (open.size() <= kept) return 0;
  const auto rank = [&](const Connection& connection) {
    const bool is_busy = connection.unanswered > 0 && now - connection.active_at < kUnansweredMax;
    return std::tuple(is_busy, ~of_process.at(connection.peer.process), connection.active_at, connection.number);
  };
  std::ranges::sort(open, {}, [&](const auto& entry) { return rank(*entry.second); });
  const std::size_t excess = open.size() - connections_max_;
  for (std::size_t i = 0; i < excess; ++i) {
    open[i].second->is_cut = true;
    system_.shut_down(open[i].first);
  }
  return excess;
}

}  // namespace moondb
