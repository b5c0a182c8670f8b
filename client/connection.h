// One DEALER to one agent's endpoint: frames out and in, with deadlines. The only file of client/ that knows ZeroMQ.
//
// Never reconnects by itself: a lost peer shows at once, and the next Open makes a new socket. Not thread-safe.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "client/client.h"

namespace moondb {

class Client::Connection {
 public:
  // `options` as given to Client::Connect.
  Connection(std::string endpoint, std::string agent_name, const Options& options);
  ~Connection();

  // Connects unless connected. kUnavailable if nobody answers within `timeout`; at once where there is no listener.
  // kRefused if the agent does not know the key.
  Result<void> Open(Duration timeout);
  void Close();

  // kUnavailable if the peer went away.
  Result<void> Send(const std::string& frame);
  bool is_keyed() const { return !secret_key_.empty(); }
  // The next frame; kTimedOut after `deadline`, kUnavailable if the peer went away.
  Result<std::string> Receive(std::chrono::steady_clock::time_point deadline);

 private:
  struct Sockets;

  Result<void> UseKeys(Sockets& sockets) const;
  // Until somebody is there.
  Result<void> WaitForPeer(Sockets& sockets, Duration timeout) const;

  std::string endpoint_;
  std::string agent_name_;
  std::size_t message_bytes_max_;
  std::string server_key_;
  std::string secret_key_;
  std::unique_ptr<Sockets> sockets_;  // Null while not connected.
};

}  // namespace moondb
