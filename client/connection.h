// A connection to one agent's endpoint over one DEALER socket: sends and receives frames, with deadlines.
//
// Never reconnects automatically: Send and Receive report a lost connection at once, and the next Open makes a new
// socket. Not thread-safe.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "client/client.h"

namespace moondb {

class Client::Connection {
 public:
  Connection(std::string endpoint, std::string agent_name, const Options& options);
  ~Connection();

  // Connects, unless connected already. Fails with kUnavailable if no process listens or the agent does not answer
  // within `timeout`. Fails with kRefused if the agent does not know the key.
  Result<void> Open(Duration timeout);
  void Close();

  // Sends one frame. Fails with kUnavailable if the connection is lost.
  Result<void> Send(const std::string& frame);
  bool is_keyed() const { return !secret_key_.empty(); }
  // Returns the next reply. Fails with kTimedOut after `deadline`, with kUnavailable if the connection is lost, and
  // with kCorrupt if a message does not end within twice the size limit.
  Result<std::string> Receive(std::chrono::steady_clock::time_point deadline);

 private:
  struct Sockets;

  Result<void> UseKeys(Sockets& sockets) const;
  // Waits until the socket is connected. Fails like Open.
  Result<void> WaitForPeer(Sockets& sockets, Duration timeout) const;

  std::string endpoint_;
  std::string agent_name_;
  std::size_t message_bytes_max_;
  std::string server_key_;
  std::string secret_key_;
  std::unique_ptr<Sockets> sockets_;  // Null while not connected.
};

}  // namespace moondb
