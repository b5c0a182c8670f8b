// UnreadReplies: limits the bytes of replies that clients on tcp:// have not read yet.
//
// A reply counts from the time when it is passed to libzmq until the client's kernel has acknowledged its bytes
// (TCP_INFO). There is a limit per client key and one for all keys together. A reply larger than the limit is allowed
// if no other reply waits. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

namespace moondb {

class UnreadReplies {
 public:
  static constexpr std::uint64_t kOfKeyMax = 8 * 1024 * 1024;
  static constexpr std::uint64_t kOfAllMax = 32 * 1024 * 1024;

  // Returns the bytes that the peer has acknowledged since the connection opened, or nothing if the descriptor is no
  // longer a connection.
  using AckedBytes = std::function<std::optional<std::uint64_t>(int file)>;

  static std::optional<std::uint64_t> AckedBytesOf(int file);

  explicit UnreadReplies(AckedBytes acked_bytes = AckedBytesOf) : acked_bytes_(std::move(acked_bytes)) {}

  // Call when a request arrived with this routing id, from a client with this key, over the connection with descriptor
  // `file`.
  void OnRequest(const std::string& route, const std::string& key, int file);
  // Returns true if a reply of this size may be passed to libzmq for this routing id. Always true for a routing id
  // without requests.
  bool HasRoom(const std::string& route, std::uint64_t bytes);
  // Counts a reply that was passed to libzmq.
  void Count(const std::string& route, std::uint64_t bytes);

  // Returns the key of the last request with this routing id, or "" if there was none.
  std::string KeyOf(const std::string& route) const;

 private:
  struct Connection {
    std::string key;
    int file = -1;
    std::uint64_t acked_before = 0;  // Acknowledged bytes when Count was last called with no reply waiting.
    std::uint64_t given = 0;         // Bytes passed to libzmq since acked_before was read.
  };

  // Returns the bytes that the client has not acknowledged, or nothing if the connection is closed.
  std::optional<std::uint64_t> WaitingOf(const Connection& connection) const;

  AckedBytes acked_bytes_;
  std::map<std::string, Connection> connections_;  // Connections by routing id.
};

}  // namespace moondb
