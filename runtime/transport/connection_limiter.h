// ConnectionLimiter: cuts the TCP connections to this agent that take more than their due (connection_rules.h), which
// libzmq by itself does not bound. Upon the cut libzmq closes the connection and frees what it had received of a
// message.
//
// It also watches the links, the connections that this agent opened to its peers. Nothing but the handshake arrives
// over a link, so a peer that sends more than kLinkBytesMax over one is reported (TakeFloodedLinks).
//
// It looks a moment after anything came over any of them, a few times more at growing intervals, and not at all while
// nothing comes, so that an agent at rest sleeps. Between two looks
// a connection takes what the network brings: some 10 MB at the rate at which libzmq reads.
//
// The transport's thread; cut_* any thread.
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
#include "runtime/transport/tcp_connections.h"

namespace moondb {

class ConnectionLimiter {
 public:
  static constexpr Duration kLookAfter = std::chrono::milliseconds(50);
  static constexpr Duration kLookAfterMax = std::chrono::milliseconds(800);

  // By port. kUnavailable: the process may open no more files.
  static Result<std::unique_ptr<ConnectionLimiter>> Make(std::map<std::uint16_t, ConnectionRules::Listener> listeners);

  // A handshake takes less than 1 KiB.
  static constexpr std::uint64_t kLinkBytesMax = 64 * 1024;

  // libzmq accepted a connection with this descriptor.
  void OnAccepted(int file, MonotonicTime now);
  // libzmq opened the connection of the link to this agent, with this descriptor.
  void OnLinkConnected(AgentId peer, int file, MonotonicTime now);
  // Returns the agents that sent more than kLinkBytesMax over the link to them since its connection opened; each once
  // for each connection.
  std::vector<AgentId> TakeFloodedLinks() { return std::exchange(flooded_links_, {}); }

  // Readable when something came: then OnReadable.
  int file() const { return connections_->file(); }
  void OnReadable(MonotonicTime now);
  // When Work has something to do.
  MonotonicTime deadline() const { return looks_at_; }
  void Work(MonotonicTime now);

  // A whole message came from the connection that has this file (ConnectionRules::OnMessage).
  void OnMessage(int file, std::string_view key, std::uint16_t peer_port = 0, bool has_claimed_id = false) {
    rules_.OnMessage(file, key, peer_port, has_claimed_id);
  }
  // Returns false if the key has all its connections (ConnectionRules::Admit).
  bool Admit(std::uint16_t port, const std::string& key, const std::string& peer, MonotonicTime now);

  // Connections that were cut.
  std::uint64_t cut_for_number() const { return cut_for_number_; }
  std::uint64_t cut_for_bytes() const { return cut_for_bytes_; }
  std::uint64_t cut_for_claimed_id() const { return cut_for_claimed_id_; }

 private:
  ConnectionLimiter(std::unique_ptr<TcpConnections> connections,
                    std::map<std::uint16_t, ConnectionRules::Listener> listeners);

  void LookSoon(MonotonicTime now);
  void Look(MonotonicTime now);
  void LookAtLinks();
  void Count(const ConnectionRules::Cut& cut);

  const std::unique_ptr<TcpConnections> connections_;
  ConnectionRules rules_;
  std::map<AgentId, TcpConnection> links_;  // Those that did not send too much.
  std::vector<AgentId> flooded_links_;
  MonotonicTime looks_at_{};
  MonotonicTime looked_at_{};
  Duration next_look_after_ = kLookAfter;
  RateLimitedLog number_log_;
  RateLimitedLog bytes_log_;
  RateLimitedLog claimed_id_log_;
  std::atomic<std::uint64_t> cut_for_number_ = 0;
  std::atomic<std::uint64_t> cut_for_bytes_ = 0;
  std::atomic<std::uint64_t> cut_for_claimed_id_ = 0;
};

}  // namespace moondb
