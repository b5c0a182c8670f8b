#include "runtime/transport/connection_limiter.h"

#include <sys/resource.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace moondb {
namespace {

std::set<std::uint16_t> PortsOf(const std::map<std::uint16_t, ConnectionRules::Listener>& listeners) {
  std::set<std::uint16_t> ports;
  for (const auto& [port, listener] : listeners) ports.insert(port);
  return ports;
}

// Returns the number of files that this process may open.
std::uint64_t FilesMax() {
  rlimit files{};
  return ::getrlimit(RLIMIT_NOFILE, &files) == 0 ? files.rlim_cur : 0;
}

}  // namespace

Result<std::unique_ptr<ConnectionLimiter>> ConnectionLimiter::Make(
    std::map<std::uint16_t, ConnectionRules::Listener> listeners, const std::string& local_socket) {
  Result<std::unique_ptr<TcpConnections>> connections = TcpConnections::Make(PortsOf(listeners));
  if (!connections) return tl::unexpected(connections.error());
  return std::unique_ptr<ConnectionLimiter>(
      new ConnectionLimiter(std::move(*connections), std::move(listeners), local_socket));
}

ConnectionLimiter::ConnectionLimiter(std::unique_ptr<TcpConnections> connections,
                                     std::map<std::uint16_t, ConnectionRules::Listener> listeners,
                                     const std::string& local_socket)
    : connections_(std::move(connections)),
      rules_(std::move(listeners)),
      local_(LocalConnections::LimitFor(FilesMax()), LocalConnections::SystemFor(local_socket)) {}

void ConnectionLimiter::OnAccepted(int file, MonotonicTime now) {
  connections_->OnAccepted(file);
  local_.OnAccepted(file, now);
  EvaluateSoon(now);
}

void ConnectionLimiter::CutLocal(MonotonicTime now) {
  const std::size_t cut = local_.CutExcess(now);
  if (cut == 0) return;
  cut_for_number_ += cut;
  local_log_.Warn("transport: cut connections of a client on this machine: programs here hold more than " +
                  std::to_string(local_.connections_max()) +
                  "; they must close connections or use one for all requests");
}

void ConnectionLimiter::OnLinkConnected(AgentId peer, int file, MonotonicTime now) {
  links_.erase(peer);
  if (const std::optional<TcpConnection> connection = connections_->Read(file)) links_[peer] = *connection;
  EvaluateSoon(now);
}

void ConnectionLimiter::OnReadable(MonotonicTime now) {
  connections_->Drain();
  EvaluateSoon(now);
}

void ConnectionLimiter::EvaluateSoon(MonotonicTime now) {
  next_look_after_ = kLookAfter;
  looks_at_ = std::min(looks_at_, now + kLookAfter);
}

void ConnectionLimiter::Work(MonotonicTime now) {
  if (now < looks_at_) return;
  looks_at_ = next_look_after_ <= kLookAfterMax ? now + next_look_after_ : MonotonicTime::max();
  next_look_after_ *= 2;
  Inspect(now);
}

bool ConnectionLimiter::Admit(std::uint16_t port, const std::string& key, const std::string& peer, MonotonicTime now) {
  if (rules_.Admit(port, key, peer)) return true;
  // Limit the rate: checking all connections at each of many handshakes would use a whole processor.
  if (now < looked_at_ + kLookAfter) return false;
  Inspect(now);  // Connections that closed since the last look no longer count.
  return rules_.Admit(port, key, peer);
}

void ConnectionLimiter::Inspect(MonotonicTime now) {
  looked_at_ = now;
  for (const ConnectionRules::Cut& cut : rules_.Judge(connections_->List(), now)) {
    // Count first, so that the counters include the cut when the peer notices it.
    Count(cut);
    TcpConnections::ShutDown(cut.connection);
  }
  InspectLinks();
}

// Adds flooded links to flooded_links_. Stops watching flooded links, closed links, and links whose descriptor now
// belongs to another connection.
void ConnectionLimiter::InspectLinks() {
  std::erase_if(links_, [&](const auto& entry) {
    const auto& [peer, opened] = entry;
    const std::optional<TcpConnection> now = connections_->Inspect(opened.file);
    if (!now || now->port != opened.port || now->peer != opened.peer || now->peer_port != opened.peer_port) return true;
    if (now->bytes_received <= kLinkBytesMax) return false;
    flooded_links_.push_back(peer);
    return true;
  });
}

void ConnectionLimiter::Count(const ConnectionRules::Cut& cut) {
  const std::string who =
      "transport: cut a connection from " + cut.connection.peer + " to port " + std::to_string(cut.connection.port);
  switch (cut.cause) {
    case ConnectionRules::Cause::kTooMuch:
      ++cut_for_bytes_;
      return bytes_log_.Warn(who + ": it sends a message without end");
    case ConnectionRules::Cause::kTooMany:
      ++cut_for_number_;
      return number_log_.Warn(who + ": this address has too many connections");
    case ConnectionRules::Cause::kTooManyOfKey:
      ++cut_for_number_;
      return number_log_.Warn(who + ": its key has too many connections");
    case ConnectionRules::Cause::kClaimedId:
      ++cut_for_claimed_id_;
      return claimed_id_log_.Warn(who + ": it chose its own routing id; clients over TCP leave ZMQ_ROUTING_ID unset");
  }
}

}  // namespace moondb
