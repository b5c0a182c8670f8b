// ConnectionRules: decides which incoming TCP connections to cut, because libzmq limits neither their number nor the
// memory of an incomplete message (docs/SECURITY.md).
//
// Three limits apply to each port: connections per address (JudgePlaces), connections per key (JudgeKeys), and bytes
// received since the last complete message (JudgeBytes).
//
// The key of a connection is unknown until its first message. An admission (Admit) therefore counts towards `key_max`
// until a connection from the same address completes its first message with that key. An address that has more
// admissions than connections without a message loses its oldest admissions.
//
// Holds no sockets and reads no clock: ConnectionLimiter passes the data in.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace moondb {

// An incoming connection to a port on which this process listens.
struct TcpConnection {
  int file = -1;
  std::uint16_t port = 0;            // The local port.
  std::string peer;                  // Numeric address of the peer, such as "10.0.0.3".
  std::uint16_t peer_port = 0;       // With `peer`, distinguishes the connection from later ones with the same `file`.
  std::uint64_t bytes_received = 0;  // Bytes received since the connection opened.
};

class ConnectionRules {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  // Bytes that each connection may receive after its last complete message. Exceeds the largest frame between agents.
  static constexpr std::uint64_t kFreeBytes = 320 * 1024;
  static constexpr std::chrono::hours kRememberedTime{1};
  // Limit of addresses in remembered_. Beyond it, the address that was silent for longest is forgotten.
  static constexpr std::size_t kRememberedMax = 1024;

  struct Listener {
    std::map<std::string, std::size_t> places;  // By address: limit of connections from that address.
    std::size_t others_max = 0;                 // Limit of connections from all other addresses together.
    std::size_t key_max = 0;                    // Limit of connections with one key.
    // JudgeBytes cuts connections while the bytes of large incomplete messages on the port exceed the sum of kFreeBytes
    // and this value.
    std::uint64_t shared_bytes = 0;
  };

  enum class Cause { kTooMany, kTooManyOfKey, kTooMuch, kClaimedId };
  struct Cut {
    TcpConnection connection;
    Cause cause = Cause::kTooMany;
  };

  // `listeners` holds the limits of each port.
  explicit ConnectionRules(std::map<std::uint16_t, Listener> listeners) : listeners_(std::move(listeners)) {}

  // Call when a complete message has arrived over the connection with descriptor `file`. `key`: the sender's public
  // key; empty without CURVE. `peer_port`: the peer's port, to detect that the descriptor now belongs to another
  // connection; 0 if unknown. `has_claimed_id`: the connection chose its own routing id, and must be cut.
  void OnMessage(int file, std::string_view key, std::uint16_t peer_port = 0, bool has_claimed_id = false);

  // Admits a connection from the address `peer` to `port` if `key` has fewer than `key_max` connections and admissions
  // on this port. Returns true and counts the admission; otherwise returns false.
  bool Admit(std::uint16_t port, const std::string& key, const std::string& peer);

  // Returns the connections to cut, each once. `connections` holds all current connections, in any order.
  std::vector<Cut> Judge(const std::vector<TcpConnection>& connections, Time now = {});

 private:
  struct Known {
    TcpConnection connection;
    std::uint64_t number = 0;           // Number of the connection, in the order of arrival.
    std::uint64_t bytes_delivered = 0;  // Value of bytes_received at the connection's last complete message.
    bool has_delivered = false;
    std::string key;             // Key of the connection's last message.
    std::uint64_t heard_at = 0;  // Number of the Judge call (look_) that noticed the connection's last message.
    bool has_claimed_id = false;
    bool is_cut = false;

    std::uint64_t bytes_open() const { return connection.bytes_received - bytes_delivered; }
  };

  void Update(const std::vector<TcpConnection>& connections, Time now);
  void Remember(const std::string& peer, Time now);
  void EndAdmissions();
  void JudgeClaims(std::vector<Cut>& cuts);
  // If more than `key_max` connections have completed a message with one key, cuts those that were silent for longest.
  void JudgeKeys(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts);
  // Cuts the connections of each address in `places` beyond the limit of that address, and the connections of all
  // other addresses together beyond `others_max`. Cuts first the connections that never completed a message
  // and whose address completed none within kRememberedTime, then other connections that never completed a message,
  // then all others. Among equals, the network with the most connections loses its oldest. A network is all addresses
  // with the same first 24 bits (IPv6: 64), because one host can use all of them.
  void JudgePlaces(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts);
  // Adds up the bytes of all connections that received more than kFreeBytes after their last complete message. While
  // the sum exceeds kFreeBytes + `shared_bytes`, cuts the connection with the most bytes.
  void JudgeBytes(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts);
  static void CutOff(Known& known, Cause cause, std::vector<Cut>& cuts);

  std::map<std::uint16_t, Listener> listeners_;
  std::map<int, Known> known_;  // Current connections by descriptor.
  struct Delivered {
    std::string key;
    std::uint16_t peer_port = 0;
    bool has_claimed_id = false;
  };
  std::map<int, Delivered> delivered_;  // Last message since the last call of Judge, by descriptor.
  // An admitted connection that has not completed a message yet.
  struct Admission {
    std::uint16_t port = 0;
    std::string key;
    std::string peer;
  };
  std::vector<Admission> admissions_;       // Admissions, oldest first.
  std::map<std::string, Time> remembered_;  // By address: time of the last complete message.
  std::uint64_t last_number_ = 0;
  std::uint64_t look_ = 0;
};

}  // namespace moondb
