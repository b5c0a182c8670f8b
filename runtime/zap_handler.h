// ZapHandler: says whose CURVE keys may come in, and under which name (ZeroMQ RFC 27).
//
// libzmq asks it by inproc messages during each handshake; without it, every key would be let in. A key that belongs to
// an agent gets that agent's id as User-Id, which libzmq then attaches to each frame of the connection.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "runtime/zmq_socket.h"

namespace moondb {

class ZapHandler {
 public:
  // Binds in `context`; before any socket that uses CURVE. `agents` is by public key in Z85.
  static Result<ZapHandler> Make(const ZmqContext& context, std::map<std::string, AgentId> agents);

  // Answers what waits.
  void OnReadable();
  int file() const { return socket_.file(); }

  // Handshakes of unknown keys.
  std::uint64_t refused() const { return refused_; }

 private:
  ZapHandler(ZmqSocket socket, std::map<std::string, AgentId> agents)
      : socket_(std::move(socket)), agents_(std::move(agents)) {}

  std::optional<AgentId> AgentOf(const std::vector<ZmqFrame>& request) const;

  ZmqSocket socket_;
  std::map<std::string, AgentId> agents_;
  std::uint64_t refused_ = 0;
};

// The agent that a User-Id stands for; 0 for none.
AgentId AgentOfUserId(std::string_view user_id);

}  // namespace moondb
