// UnreadReplies: limits the bytes of replies that clients on tcp:// have not read yet.
//
// A reply counts from the time when it is passed to libzmq until the client's kernel has acknowledged its bytes
// (TCP_INFO). There is a limit per client key and one for all keys together. A reply larger than the limit is allowed
// if no other reply waits. OfKey also counts the replies that were not passed to libzmq yet. Thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
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

  // Adds a reply that is not passed to libzmq yet, or removes it after Count, or if it is dropped.
  void AddWaiting(const std::string& key, std::uint64_t bytes);
  void RemoveWaiting(const std::string& key, std::uint64_t bytes);
  // Returns the bytes of all replies to clients with this key that are not acknowledged.
  std::uint64_t OfKey(const std::string& key);

 private:
  struct Connection {
    std::string key;
    int file = -1;
    std::uint64_t acked_before = 0;  // Acknowledged bytes when Count was last called with no reply waiting.
    std::uint64_t given = 0;         // Bytes passed to libzmq since acked_before was read.
  };

  // Returns the bytes that the client has not acknowledged, or nothing if the connection is closed.
  std::optional<std::uint64_t> WaitingOf(const Connection& connection) const;

  struct Sums {
    std::uint64_t of_key = 0;
    std::uint64_t of_all = 0;
  };
  // Adds up the bytes passed to libzmq and not acknowledged. Removes closed connections. Requires: mutex_ is held.
  Sums SumUp(const std::string& key);

  const AckedBytes acked_bytes_;
  std::mutex mutex_;                               // Guards all members below.
  std::map<std::string, Connection> connections_;  // Connections by routing id.
  std::map<std::string, std::uint64_t> waiting_;   // By key: bytes of the replies that AddWaiting added.
};

}  // namespace moondb
