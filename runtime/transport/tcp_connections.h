// TcpConnections: reads the kernel's state of this process's TCP connections, by the file descriptors that libzmq
// reports. libzmq owns the descriptors. This class only reads their state, and may shut a connection down; libzmq then
// closes it.
//
// A descriptor may have been closed and reused since libzmq reported it, so the peer's address is read each time. All
// other state is read again only after data arrived on the connection: with 64 agents on one machine, reading it each
// time used a tenth of the processor time. Requires Linux: TCP_INFO (tcpi_bytes_received, Linux 4.1), epoll. Not
// thread-safe.
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
  // `ports` are the ports on which this process listens. Returns kUnavailable if no more files can be opened.
  static Result<std::unique_ptr<TcpConnections>> Make(std::set<std::uint16_t> ports);
  ~TcpConnections();
  TcpConnections(const TcpConnections&) = delete;
  TcpConnections& operator=(const TcpConnections&) = delete;

  // Descriptor that becomes readable when data arrive on a connection after its state was read (List, Look, Read).
  // Drain makes the descriptor unreadable again.
  int file() const { return epoll_; }
  void Drain();

  // Call when libzmq accepted a connection with this descriptor. Connections to ports other than `ports` are ignored.
  void OnAccepted(int file);
  // Returns the accepted connections to `ports` that are established, and watches each for data. Opens no files.
  std::vector<TcpConnection> List();
  // Returns the connection with this descriptor, and watches it for data. Returns nothing if the descriptor is not an
  // established TCP connection.
  std::optional<TcpConnection> Read(int file);
  // Like Read, but returns the last read state if no data have arrived on the connection since then.
  std::optional<TcpConnection> Inspect(int file);

  // Returns the peer's port, or 0 if the descriptor is not a connection.
  static std::uint16_t PeerPortOf(int file);
  // Shuts the connection down in both directions. No effect if its descriptor is no longer a socket.
  static void ShutDown(const TcpConnection& connection);

 private:
  // State of a connection, valid until data arrive on it.
  struct Known {
    sockaddr_storage peer;
    TcpConnection connection;
  };

  TcpConnections(std::set<std::uint16_t> ports, int epoll) : ports_(std::move(ports)), epoll_(epoll) {}

  const std::set<std::uint16_t> ports_;
  const int epoll_;
  std::set<int> accepted_;      // Accepted descriptors that are not known to be closed.
  std::map<int, Known> known_;  // Last read state by descriptor.
};

}  // namespace moondb
