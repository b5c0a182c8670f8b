// TcpConnections: TCP connections of this process, as the kernel knows them, by the file descriptors that libzmq
// reports. libzmq owns the descriptors. This class only reads their state, and may shut a connection down; libzmq then
// closes it.
//
// A descriptor may have been closed and reused since libzmq reported it, so the address of its peer is read each time.
// All else is read only after something happened to the connection: with 64 agents on one machine those system calls
// took a tenth of the processors. Linux: TCP_INFO (tcpi_bytes_received, Linux 4.1), epoll. Not thread-safe.
#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "model/error.h"
#include "runtime/transport/connection_rules.h"

namespace moondb {

class TcpConnections {
 public:
  // `ports`: those on which this process listens. kUnavailable if the process may open no more files.
  static Result<std::unique_ptr<TcpConnections>> Make(std::set<std::uint16_t> ports);
  ~TcpConnections();
  TcpConnections(const TcpConnections&) = delete;
  TcpConnections& operator=(const TcpConnections&) = delete;

  // Readable when a connection received something since List, Look or Read looked at it, until Drain.
  int file() const { return epoll_; }
  void Drain();

  // Somebody connected to one of the ports, with this descriptor here. Another descriptor is ignored.
  void OnAccepted(int file);
  // Returns the connections to the ports that are established now, and watches each. Opens no files.
  std::vector<TcpConnection> List();
  // Returns the connection with this descriptor, and watches it; none if it is not an established TCP connection.
  std::optional<TcpConnection> Read(int file);
  // Returns the same, and reads a connection that is known already again only if something arrived over it.
  std::optional<TcpConnection> Look(int file);

  // Returns the peer's port; 0 if it is no connection.
  static std::uint16_t PeerPortOf(int file);
  // Ends the connection for both sides. Does nothing if its descriptor is not a socket any more.
  static void ShutDown(const TcpConnection& connection);

 private:
  // A connection as it was read, while nothing was received over it since.
  struct Known {
    sockaddr_storage peer;
    TcpConnection connection;
  };

  TcpConnections(std::set<std::uint16_t> ports, int epoll) : ports_(std::move(ports)), epoll_(epoll) {}

  const std::set<std::uint16_t> ports_;
  const int epoll_;
  std::set<int> accepted_;      // Not known to be closed.
  std::map<int, Known> known_;  // By descriptor.
};

}  // namespace moondb
