// TcpConnections: the TCP connections that others opened to ports on which this process listens, as the system knows
// them. libzmq owns their files; this only looks, and may shut one down, upon which libzmq closes it.
//
// Linux: /proc/self/fd, TCP_INFO (tcpi_bytes_received, Linux 4.1), epoll. One thread.
#pragma once

#include <dirent.h>

#include <cstdint>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "model/error.h"
#include "runtime/transport/connection_rules.h"

namespace moondb {

class TcpConnections {
 public:
  // Keeps open what it needs, and so looks where the process may open no more files. kUnavailable: already now.
  static Result<std::unique_ptr<TcpConnections>> Watch(std::set<std::uint16_t> ports);
  ~TcpConnections();
  TcpConnections(const TcpConnections&) = delete;
  TcpConnections& operator=(const TcpConnections&) = delete;

  // Readable when one of them received something since the last List, or somebody connected, until Drain: while nothing
  // happens nobody has to look.
  int file() const { return epoll_; }
  void Drain();

  // Those that there are now.
  std::vector<TcpConnection> List();

  // Its end for both sides. No harm where the connection is gone and its file is another one's that is no socket.
  static std::uint16_t PeerPortOf(int file);  // 0 where it is no connection.
  static void ShutDown(const TcpConnection& connection);

 private:
  void Arm(int file) const;

  TcpConnections(std::set<std::uint16_t> ports, int epoll, DIR* own_files)
      : ports_(std::move(ports)), epoll_(epoll), own_files_(own_files) {}

  const std::set<std::uint16_t> ports_;
  const int epoll_;
  DIR* const own_files_;  // /proc/self/fd
  std::set<int> listeners_;
};

}  // namespace moondb
