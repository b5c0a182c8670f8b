// ConnectionRules: which of the TCP connections that others opened to this agent take more than their due, before or
// after anybody knows who they are (docs/SECURITY.md). libzmq bounds neither how many there are nor what a message of
// theirs takes until it is whole.
//
// Places: each address of the team has places of its own, which nobody else can take; all other addresses share some.
// Where there are too many, those go first that never brought a whole message and come from an address from which none
// came within the last hour, then other ones that never brought a message; of equal ones the oldest of the network that
// has most. A network is all addresses that have the first 24 bits in common, with IPv6 the first 64: one host can have
// them all. Of one key there are at most `key_max` that ever brought a message: beyond them the one goes that was
// silent for longest, so that no key takes the places of another one.
//
// A key that has `key_max` connections is not admitted once more (Admit). Until a connection brings a message nobody
// can say which key it has, so an admission counts until a connection from the same address brings its first message
// with that key, or until that address has fewer silent connections than admissions; then the oldest admission ends.
//
// Bytes: a connection may have received kFreeBytes since its last whole message, which is more than any frame between
// agents has. What goes beyond is a client's large message, what this agent is slow to read, or a message that never
// ends: at each door all of it together may be `shared_bytes`; above that the connection with the most goes. Parts of
// one byte take some four times as much memory as they have on the wire.
//
// A plain value that looks at nothing by itself: ConnectionLimiter feeds it.
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

// One that others opened to a port on which this process listens.
struct TcpConnection {
  int file = -1;
  std::uint16_t port = 0;            // This agent's.
  std::string peer;                  // "10.0.0.3"
  std::uint16_t peer_port = 0;       // With `peer` and `file` it tells a connection from a later one.
  std::uint64_t bytes_received = 0;  // Since it was opened.
};

class ConnectionRules {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  static constexpr std::uint64_t kFreeBytes = 320 * 1024;
  static constexpr std::chrono::hours kRememberedTime{1};
  static constexpr std::size_t kRememberedMax = 1024;  // Addresses; the one that was silent for longest is forgotten.

  struct Listener {
    std::map<std::string, std::size_t> places;  // By address.
    std::size_t others_max = 0;                 // Connections from all other addresses together.
    std::size_t key_max = 0;                    // Connections with one key.
    std::uint64_t shared_bytes = 0;
  };

  enum class Cause { kTooMany, kTooManyOfKey, kTooMuch, kClaimedId };
  struct Cut {
    TcpConnection connection;
    Cause cause = Cause::kTooMany;
  };

  // By port.
  explicit ConnectionRules(std::map<std::uint16_t, Listener> listeners) : listeners_(std::move(listeners)) {}

  // A whole message came from the connection that has this file. `key`: of whom it is; empty without CURVE.
  // `peer_port`: where it is known, so that nothing is taken for a later connection's with the same file; 0: it is not.
  // `has_claimed_id`: the connection chose a routing id for itself, and is cut.
  void OnMessage(int file, std::string_view key, std::uint16_t peer_port = 0, bool has_claimed_id = false);

  // Counts a connection from `peer` to `port` whose handshake shows that it has this key. Returns false, and counts
  // nothing, if the key has `key_max` connections by the last Judge and by the admissions since.
  bool Admit(std::uint16_t port, const std::string& key, const std::string& peer);

  // All that there are at this time, in any order; each that is to be cut is named once.
  std::vector<Cut> Judge(const std::vector<TcpConnection>& connections, Time now = {});

 private:
  struct Known {
    TcpConnection connection;
    std::uint64_t number = 0;           // As they came.
    std::uint64_t bytes_delivered = 0;  // The bytes it had received at its last whole message.
    bool has_delivered = false;
    std::string key;             // Of its last message.
    std::uint64_t heard_at = 0;  // The look at which its last message was known.
    bool has_claimed_id = false;
    bool is_cut = false;

    std::uint64_t bytes_open() const { return connection.bytes_received - bytes_delivered; }
  };

  void Update(const std::vector<TcpConnection>& connections, Time now);
  void Remember(const std::string& peer, Time now);
  void EndAdmissions();
  void JudgeClaims(std::vector<Cut>& cuts);
  void JudgeKeys(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts);
  void JudgePlaces(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts);
  void JudgeBytes(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts);
  static void CutOff(Known& known, Cause cause, std::vector<Cut>& cuts);

  std::map<std::uint16_t, Listener> listeners_;
  std::map<int, Known> known_;  // By file.
  struct Delivered {
    std::string key;
    std::uint16_t peer_port = 0;
    bool has_claimed_id = false;
  };
  std::map<int, Delivered> delivered_;  // Since the last look, by file.
  // Of a connection that has not brought a message yet.
  struct Admission {
    std::uint16_t port = 0;
    std::string key;
    std::string peer;
  };
  std::vector<Admission> admissions_;       // Oldest first.
  std::map<std::string, Time> remembered_;  // Addresses, and when a whole message last came from them.
  std::uint64_t last_number_ = 0;
  std::uint64_t look_ = 0;
};

}  // namespace moondb
