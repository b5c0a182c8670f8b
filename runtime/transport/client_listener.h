// ClientListener: a ROUTER socket that receives the requests of an agent's clients and sends the replies. Over ipc://,
// in a folder that only this user can enter, clients have all rights. Over tcp://, with CURVE, a client has the rights
// of its key at the time of each request.
//
// libzmq aborts the process if a client connects while no more files can be opened, and libzmq cannot limit the number
// of clients. ConnectionLimiter limits it, for clients over ipc by LocalConnections. The limit on open files must be
// well above the number of clients, including those in their handshake. A client_address belongs on a private network.
//
// libzmq also aborts the process if a TCP client has claimed the routing id that the ROUTER assigns next. These ids are
// consecutive numbers from a random start, which no client knows. ClientListener reads the start, and reports each
// message with an id that the ROUTER has not assigned as a claimed id (docs/SECURITY.md).
//
// Send and UnreadBytes are thread-safe. All other functions must be called on the transport's thread.
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
  // Limit of concurrent connections with one key (ConnectionRules::Listener::key_max). The routing ids of this many
  // connections per key are kept, including closed connections.
  static constexpr std::size_t kConnectionsOfKeyMax = 15;

  // Returns the identity of the client with this key (Z85), according to the current client list.
  using IdentityOf = std::function<ClientIdentity(const std::string& key)>;

  struct Options {
    AgentId self = 0;
    std::string endpoint;               // ipc://..., or tcp://, which also requires secret_key and identity_of.
    std::size_t message_bytes_max = 0;  // Size limit of a request or reply.
    std::string secret_key;
    IdentityOf identity_of;
    // Over tcp:// only: called when a complete message has arrived over the connection with descriptor `file`, from a
    // client with `key`. `has_claimed_id`: the client chose its routing id itself.
    std::function<void(int file, std::string_view key, bool has_claimed_id)> on_message;
    // Over ipc:// only: called when a request arrived with the routing id `route` over the connection with descriptor
    // `file`, and when a reply was sent to `route`.
    std::function<void(int file, const std::string& route)> on_local_request;
    std::function<void(const std::string& route)> on_local_reply;
    // Over tcp:// only: returns the number of handshakes admitted so far. The ROUTER has assigned at most this many
    // routing ids.
    std::function<std::uint32_t()> admitted_handshakes;
    // Called with the socket before it starts to listen.
    std::function<Result<void>(ZmqSocket& listener)> before_listening;
  };

  // Opens the socket. Requires: `wake_up` outlives the object; at most one of an agent's two ClientListeners uses
  // tcp://. Returns kUnavailable if the address is in use, kInvalid if the folder is not private to this user. A
  // missing folder is created.
  static Result<std::unique_ptr<ClientListener>> Open(const ZmqContext& context, WakeUp& wake_up, Options options);

  // Removes the file of the ipc socket, which libzmq 4.3.4 leaves.
  ~ClientListener();

  // Sends a reply to the client `name` (ClientTable). Returns kUnreachable if the client is unknown, kFull if too many
  // replies wait or the message is too large. Instead of a message that is too large, the client receives an error with
  // the same request_id.
  SendResult Send(const std::string& name, const proto::Message& message);

  // Returns the bytes of replies that the clients with the key of client `name` have not acknowledged; 0 for a client
  // over ipc, and for an unknown client. Thread-safe.
  std::uint64_t UnreadBytes(const std::string& name);

  // Sends waiting replies and delivers a limited number of requests. Returns true if further replies or requests wait.
  bool Work(const Transport::Deliver& deliver);
  bool has_replies() const;

  // Listens again if the ipc socket's file was removed, for example by a login manager at logout. New clients cannot
  // connect until then. Call periodically.
  void KeepPlace(std::chrono::steady_clock::time_point now);
  // Time at which KeepPlace or Work must run at the latest.
  std::chrono::steady_clock::time_point deadline() const;

  int file() const { return router_.file(); }

 private:
  struct Reply {
    ZmqFrame route;
    ZmqFrame frame;
    std::string key;        // Key of the client; empty over ipc.
    std::size_t bytes = 0;  // Size of `frame`, which is empty once libzmq has accepted it.
    std::chrono::steady_clock::time_point held_since{};
  };

  ClientListener(ZmqSocket router, std::uint32_t first_id, WakeUp& wake_up, Options options);

  SendResult Push(const std::string& name, const std::string& routing_id, const proto::Message& message,
                  std::size_t bytes);
  bool Receive(const Transport::Deliver& deliver);
  void OnFrame(const ZmqReceived& received, const Transport::Deliver& deliver);
  void Flush();
  // Passes a reply to libzmq. Returns true if libzmq accepted the reply or the reply was dropped, false if its client
  // must read earlier replies first.
  bool Hand(Reply& reply);
  // Keeps a reply until its client has read earlier replies. Drops the reply if too many are held.
  void Hold(Reply reply);
  // Passes the held replies to libzmq whose clients have read earlier replies.
  void RetryHeld(std::chrono::steady_clock::time_point now);
  // Stops counting a reply that was passed to libzmq or dropped.
  void Settle(const Reply& reply);
  bool is_keyed() const { return options_.identity_of != nullptr; }
  bool HasAssigned(std::string_view routing_id) const;

  const Options options_;
  ZmqSocket router_;
  const std::uint32_t first_id_;  // Over tcp:// only: the number that FirstNumberOf returned.
  WakeUp& wake_up_;
  ClientTable table_;
  RateLimitedLog log_;
  bool is_listening_ = true;
  // Time at which KeepPlace next checks whether the socket's file exists, or tries to listen again.
  std::chrono::steady_clock::time_point looks_at_{};

  // Over tcp:// only. `unread_` counts the replies that clients have not read yet, those in replies_ and held_ too.
  UnreadReplies unread_;
  // The replies, oldest first, whose clients must read earlier replies first. Transport's thread only.
  std::deque<Reply> held_;
  std::chrono::steady_clock::time_point tries_held_at_{};

  mutable std::mutex mutex_;
  std::deque<Reply> replies_;
  std::size_t reply_bytes_ = 0;  // Bytes of the frames in replies_.
};

}  // namespace moondb
