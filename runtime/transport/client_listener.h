// ClientListener: a ROUTER at which an agent's clients ask and are answered: on ipc:// in a folder that only this user
// can enter, where clients have all rights; or on tcp:// under CURVE, where a client has the rights that its key has at
// each request.
//
// libzmq ends the process when a client connects and the process may open no more files, and cannot be told how many
// clients to let in: the limit on open files has to be well above the number of clients, those that are still at their
// handshake included: a client_address belongs on a network of one's own.
//
// A ROUTER numbers its connections upwards from a random number, and libzmq ends the process if a connection has
// claimed the next number as its routing id. So the door learns its first number, which nobody else knows, and a
// connection over TCP whose message comes with an id that the ROUTER did not assign is reported as claimed
// (docs/SECURITY.md).
//
// Send: any thread. All else: the transport's thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "model/error.h"
#include "runtime/rate_limited_log.h"
#include "runtime/transport.h"
#include "runtime/transport/client_table.h"
#include "runtime/transport/inbound.h"
#include "runtime/transport/unread_replies.h"
#include "runtime/transport/wake_up.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb {

class ClientListener {
 public:
  // So many connections of one key there may be at once (ConnectionRules::Door::key_max), and so many are remembered to
  // be answered, also of those that left.
  static constexpr std::size_t kConnectionsOfKeyMax = 15;

  // Who comes with this key (Z85), at this moment.
  using IdentityOf = std::function<ClientIdentity(const std::string& key)>;

  struct Options {
    AgentId self = 0;
    std::string endpoint;               // ipc://..., or tcp:// and then with both of the next.
    std::size_t message_bytes_max = 0;  // Of requests and replies.
    std::string secret_key;             // The agent's.
    IdentityOf identity_of;
    // With keys: a whole message came over the connection of this file, from who has this key.
    std::function<void(int file, std::string_view key, bool has_claimed_id)> on_message;
    // With keys: how many handshakes were admitted so far. The ROUTER has assigned at most so many routing ids.
    std::function<std::uint32_t()> admitted_handshakes;
    // With keys: called with the socket before it listens.
    std::function<Result<void>(ZmqSocket& listener)> before_listening;
  };

  // `wake_up` outlives the door; of two doors of one agent one is keyed. kUnavailable for an address in use, kInvalid
  // for a folder that is not this user's alone (it is made if it is missing).
  static Result<std::unique_ptr<ClientListener>> Open(const ZmqContext& context, WakeUp& wake_up, Options options);

  // To the client that is named so (runtime/transport/client_table.h). kUnreachable if it is not known; kFull if too
  // much waits, and for a message that is too large: its client is then answered with an error of the same request_id.
  SendResult Send(const std::string& name, const proto::Message& message);

  // Hands in requests and hands out replies, at most so many that others have their turn. True if more wait.
  bool Work(const Transport::Deliver& deliver);
  bool has_replies() const;

  // Listens anew where somebody has removed the socket's file, as a login manager does at logout: until then nobody new
  // comes in. To be called now and then.
  void KeepPlace(std::chrono::steady_clock::time_point now);
  // When KeepPlace or Work has something to do for sure.
  std::chrono::steady_clock::time_point deadline() const;

  int file() const { return router_.file(); }

 private:
  struct Reply {
    ZmqFrame route;
    ZmqFrame frame;
    std::chrono::steady_clock::time_point held_since{};
  };

  ClientListener(ZmqSocket router, std::uint32_t first_id, WakeUp& wake_up, Options options);

  SendResult Push(const std::string& routing_id, const proto::Message& message, std::size_t bytes);
  bool Receive(const Transport::Deliver& deliver);
  void OnFrame(const ZmqReceived& received, const Transport::Deliver& deliver);
  void Flush();
  // True: libzmq has the reply, or it was dropped. False: its client has to read others first.
  bool Hand(Reply& reply);
  void Hold(Reply reply);
  bool is_keyed() const { return options_.identity_of != nullptr; }
  bool HasAssigned(std::string_view routing_id) const;

  const Options options_;
  ZmqSocket router_;
  const std::uint32_t first_id_;  // With keys: the ROUTER's number for its first connection, this process's own.
  WakeUp& wake_up_;
  ClientTable table_;
  RateLimitedLog log_;
  bool is_listening_ = true;
  std::chrono::steady_clock::time_point looks_at_{};  // When KeepPlace looks again.

  // With keys: replies whose clients have to read others first, oldest first. The transport's thread alone.
  UnreadReplies unread_;
  std::deque<Reply> held_;
  std::chrono::steady_clock::time_point tries_held_at_{};

  mutable std::mutex mutex_;
  std::deque<Reply> replies_;
  std::size_t reply_bytes_ = 0;  // Of their frames.
};

}  // namespace moondb
