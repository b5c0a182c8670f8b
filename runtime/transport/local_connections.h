// LocalConnections: limits the connections of clients over ipc, because libzmq does not limit them and aborts the
// process if a client connects while no more files can be opened. A program that opens a connection for each request
// and closes none would otherwise end the agent.
//
// Beyond the limit, connections without an unanswered request are cut first. Among them, the process with the most
// connections loses the connection that was silent for longest. A cut is a shutdown of the socket. libzmq then closes
// the connection, and libzmq in the client connects again by itself.
//
// Transport's thread only.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

namespace moondb {

class LocalConnections {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  static constexpr std::size_t kConnectionsMax = 1024;
  // A request without an answer counts for this long. The gateway answers each request earlier, except orders that
  // wait.
  static constexpr std::chrono::minutes kUnansweredMax{11};

  // An open connection of the socket for local clients.
  struct Peer {
    std::uint64_t socket = 0;  // Number of the socket (inode). A descriptor that was reused has another number.
    int process = 0;           // Process id of the client.
  };
  struct System {
    // Returns nothing if the descriptor is not a connection of the socket for local clients.
    std::function<std::optional<Peer>(int file)> peer_of;
    // Returns Peer::socket of the descriptor, or 0 if it is closed. Takes a third of the time of peer_of.
    std::function<std::uint64_t(int file)> socket_of;
    std::function<void(int file)> shut_down;
  };
  // Returns the functions of the operating system. `path`: the file of the socket for local clients.
  static System SystemFor(const std::string& path);
  // Returns the limit for a process that may open `files_max` files: a quarter of them, at most kConnectionsMax.
  static std::size_t LimitFor(std::uint64_t files_max);

  LocalConnections(std::size_t connections_max, System system)
      : connections_max_(connections_max), system_(std::move(system)) {}

  // Call when libzmq accepted a connection with this descriptor. Connections of other sockets are ignored.
  void OnAccepted(int file, Time now);
  // Call when a request arrived with this routing id over the connection with this descriptor.
  void OnRequest(int file, const std::string& route, Time now);
  // Call when a reply was sent to this routing id.
  void OnReply(const std::string& route);
  std::size_t connections_max() const { return connections_max_; }
  // Cuts connections down to the limit if it is exceeded by more than an eighth. Cutting several at a time keeps the
  // cost low while many clients connect again and again. Returns the number of connections cut.
  std::size_t CutExcess(Time now);

 private:
  struct Connection {
    Peer peer;
    std::string route;  // Empty until the first request.
    Time active_at{};   // Time of the last request, or of the accept.
    std::uint64_t number = 0;
    std::size_t unanswered = 0;  // Requests without a reply.
    bool is_cut = false;
  };

  // Returns the connection with this descriptor. Replaces the entry of an earlier connection with the same descriptor.
  Connection* Refresh(int file, Time now);
  void Erase(std::map<int, Connection>::iterator entry);
  void EraseClosed();

  const std::size_t connections_max_;
  const System system_;
  std::map<int, Connection> connections_;     // By descriptor. May contain closed connections.
  std::map<std::string, int> file_of_route_;  // Descriptors of the connections that have a route.
  std::uint64_t last_number_ = 0;
};

}  // namespace moondb
