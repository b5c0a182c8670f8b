// ZapHandler: says whose CURVE keys may come in, and under which name (ZeroMQ RFC 27).
//
// libzmq asks it by inproc messages during each handshake; without it, every key would be let in. A key that belongs to
// an agent gets that agent's id as User-Id, which libzmq then attaches to each frame of the connection. At a socket of
// the domain kClientDomain clients' keys are let in instead, with the key itself (Z85) as User-Id.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb {

class ZapHandler {
 public:
  static constexpr char kAgentDomain[] = "moondb";
  static constexpr char kClientDomain[] = "moondb-clients";
  using IsClient = std::function<bool(const std::string& key)>;

  // Binds in `context`; before any socket that uses CURVE. `agents` is by public key in Z85.
  static Result<ZapHandler> Make(const ZmqContext& context, std::map<std::string, AgentId> agents);
  void LetClientsIn(IsClient is_client) { is_client_ = std::move(is_client); }

  // Answers what waits.
  void OnReadable();
  int file() const { return socket_.file(); }

  // Handshakes of unknown keys.
  std::uint64_t refused_agents() const { return refused_agents_; }
  std::uint64_t refused_clients() const { return refused_clients_; }

 private:
  ZapHandler(ZmqSocket socket, std::map<std::string, AgentId> agents)
      : socket_(std::move(socket)), agents_(std::move(agents)) {}

  // The User-Id of whoever asks to come in; none: nobody who is known.
  std::optional<std::string> UserOf(const std::vector<ZmqFrame>& request) const;

  ZmqSocket socket_;
  std::map<std::string, AgentId> agents_;
  IsClient is_client_;
  std::uint64_t refused_agents_ = 0;
  std::uint64_t refused_clients_ = 0;
};

// The agent that a User-Id stands for; 0 for none.
AgentId AgentOfUserId(std::string_view user_id);

}  // namespace moondb
