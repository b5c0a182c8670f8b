// UnreadReplies: how many bytes of replies wait for clients with keys that have not read them.
//
// libzmq and the kernel keep what a client does not read. So each reply that libzmq is given counts for its connection
// until the client's system has acknowledged its bytes (TCP_INFO). Replies of one key, and of all keys, have a limit;
// a reply that is larger than the limit has room while no other waits. Used by one thread.
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

  // The bytes that the peer of a connection has acknowledged since it was made; none: the file is no connection (any
  // more).
  using AckedBytes = std::function<std::optional<std::uint64_t>(int file)>;

  static std::optional<std::uint64_t> AckedBytesOf(int file);

  explicit UnreadReplies(AckedBytes acked_bytes = AckedBytesOf) : acked_bytes_(std::move(acked_bytes)) {}

  // A request came with this routing id, from who has this key, over the connection of this file.
  void OnRequest(const std::string& route, const std::string& key, int file);
  // Whether libzmq may be given one more reply of so many bytes for this routing id; true for one that never asked.
  bool HasRoom(const std::string& route, std::uint64_t bytes);
  // libzmq was given it.
  void Count(const std::string& route, std::uint64_t bytes);

  // The key that last asked with this routing id; empty: none.
  std::string KeyOf(const std::string& route) const;

 private:
  struct Connection {
    std::string key;
    int file = -1;
    std::uint64_t acked_before = 0;  // When nothing waited.
    std::uint64_t given = 0;         // Since then.
  };

  // None: the connection is gone, and libzmq has dropped what waited.
  std::optional<std::uint64_t> WaitingOf(const Connection& connection) const;

  AckedBytes acked_bytes_;
  std::map<std::string, Connection> connections_;  // By routing id.
};

}  // namespace moondb
