// ConnectionLimiter: cuts incoming TCP connections that exceed their limits (connection_rules.h), because libzmq does
// not limit them. After a cut, which is a TCP shutdown, libzmq closes the connection and frees the partial message.
//
// Also cuts connections of clients over ipc beyond their limit (local_connections.h), as soon as libzmq has accepted
// too many.
//
// Also watches the links: the connections that this agent opened to its peers. Over a link, a peer may send only its
// part of the handshake. TakeFloodedLinks reports a peer that sends more than kLinkBytesMax.
//
// The connections are checked shortly after data arrive on any of them, then a few times at growing intervals. Without
// traffic there are no checks, and an idle agent sleeps. Between two checks a connection can receive about 10 MB, at
// the rate at which libzmq reads.
//
// Transport's thread only, except the cut_* functions, which are thread-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "runtime/rate_limited_log.h"
#include "runtime/transport.h"
#include "runtime/transport/connection_rules.h"
#include "runtime/transport/local_connections.h"
#include "runtime/transport/tcp_connections.h"

namespace moondb {

class ConnectionLimiter {
 public:
  static constexpr Duration kLookAfter = std::chrono::milliseconds(50);
  static constexpr Duration kLookAfterMax = std::chrono::milliseconds(800);

  // `listeners` holds the limits of each listening port. Returns kUnavailable if no more files can be opened.
  // `local_socket`: the file of the socket for clients over ipc; empty if there is none.
  static Result<std::unique_ptr<ConnectionLimiter>> Make(std::map<std::uint16_t, ConnectionRules::Listener> listeners,
                                                         const std::string& local_socket = {});

  // Maximum bytes that a peer may send over a link while it is connected. A peer sends only its part of the handshake
  // there, which takes less than 1 KiB.
  static constexpr std::uint64_t kLinkBytesMax = 64 * 1024;

  // Call when libzmq accepted a connection with this file descriptor.
  void OnAccepted(int file, MonotonicTime now);
  // Cuts connections of clients over ipc beyond their limit. Call after OnAccepted.
  void CutLocal(MonotonicTime now);
  // The connections of clients over ipc.
  LocalConnections& local() { return local_; }
  // Call when libzmq opened the link's connection to `peer` with this file descriptor.
  void OnLinkConnected(AgentId peer, int file, MonotonicTime now);
  // Returns the agents that sent more than kLinkBytesMax over a link since its connection opened. Each connection is
  // reported once.
  std::vector<AgentId> TakeFloodedLinks() { return std::exchange(flooded_links_, {}); }

  // Descriptor that becomes readable when data arrive on a connection. Call OnReadable then.
  int file() const { return connections_->file(); }
  void OnReadable(MonotonicTime now);
  // Time at which Work must be called next.
  MonotonicTime deadline() const { return looks_at_; }
  void Work(MonotonicTime now);

  // Call when a complete message has arrived over the connection with this descriptor (ConnectionRules::OnMessage).
  void OnMessage(int file, std::string_view key, std::uint16_t peer_port = 0, bool has_claimed_id = false) {
    rules_.OnMessage(file, key, peer_port, has_claimed_id);
  }
  // Returns the result of ConnectionRules::Admit. If that is false and no check of the connections was recent, first
  // checks all connections, after which closed connections no longer count, and tries once more.
  bool Admit(std::uint16_t port, const std::string& key, const std::string& peer, MonotonicTime now);

  // Numbers of connections that were cut, by cause.
  std::uint64_t cut_for_number() const { return cut_for_number_; }
  std::uint64_t cut_for_bytes() const { return cut_for_bytes_; }
  std::uint64_t cut_for_claimed_id() const { return cut_for_claimed_id_; }

 private:
  ConnectionLimiter(std::unique_ptr<TcpConnections> connections,
                    std::map<std::uint16_t, ConnectionRules::Listener> listeners, const std::string& local_socket);

  void EvaluateSoon(MonotonicTime now);
  void Inspect(MonotonicTime now);
  void InspectLinks();
  void Count(const ConnectionRules::Cut& cut);

  const std::unique_ptr<TcpConnections> connections_;
  ConnectionRules rules_;
  LocalConnections local_;
  std::map<AgentId, TcpConnection> links_;  // Links that have not exceeded kLinkBytesMax.
  std::vector<AgentId> flooded_links_;
  MonotonicTime looks_at_{};
  MonotonicTime looked_at_{};
  Duration next_look_after_ = kLookAfter;
  RateLimitedLog number_log_;
  RateLimitedLog local_log_;
  RateLimitedLog bytes_log_;
  RateLimitedLog claimed_id_log_;
  std::atomic<std::uint64_t> cut_for_number_ = 0;
  std::atomic<std::uint64_t> cut_for_bytes_ = 0;
  std::atomic<std::uint64_t> cut_for_claimed_id_ = 0;
};

}  // namespace moondb
