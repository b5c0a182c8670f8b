// ZmqSocket, ZmqFrame: one libzmq socket and one of its messages, owned. libzmq's calls, without exceptions.
//
// Not thread-safe: one thread at a time, with a lock between two of them.
#pragma once

#include <zmq.h>

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"

namespace moondb {

struct ZmqContextDeleter {
  void operator()(void* context) const;
};
// Destroy after all of its sockets: it waits for them.
using ZmqContext = std::unique_ptr<void, ZmqContextDeleter>;

// Also seeds rand(), once in a process, from the system's random numbers. libzmq draws the first routing id of each
// ROUTER from rand(), and ends the process if a peer has claimed an id before a ROUTER assigns it.
ZmqContext MakeZmqContext(int io_threads);

// Bytes in libzmq's own memory, so that they are copied neither into a socket nor out of it.
class ZmqFrame {
 public:
  ZmqFrame() { zmq_msg_init(&message_); }
  explicit ZmqFrame(std::size_t size);  // To be written by data().
  explicit ZmqFrame(std::string_view text);
  ZmqFrame(ZmqFrame&& other) noexcept : ZmqFrame() { zmq_msg_move(&message_, &other.message_); }
  ZmqFrame& operator=(ZmqFrame&& other) noexcept {
    if (this != &other) zmq_msg_move(&message_, &other.message_);
    return *this;
  }
  ~ZmqFrame() { zmq_msg_close(&message_); }

  char* data() { return static_cast<char*>(zmq_msg_data(&message_)); }
  std::size_t size() const { return zmq_msg_size(&message_); }
  std::string_view text() const;
  // What the ZAP handler called the sender; empty without CURVE.
  std::string_view user_id() const;

 private:
  friend class ZmqSocket;
  mutable zmq_msg_t message_;  // libzmq reads it through pointers to non-const.
};

// A received message.
struct ZmqReceived {
  ZmqFrame route;         // The routing id that a ROUTER puts before the message; empty from another socket.
  ZmqFrame frame;         // The first part. Further parts are read and dropped.
  std::size_t parts = 0;  // Of the message, without the route.
  int file = -1;          // File descriptor of the connection it came over. By now the kernel may have reused it.
};

// A connection to a door that has not finished its handshake by then is closed.
inline constexpr int kHandshakeMax_ms = 2000;

// Of a monitor: a ZMQ_EVENT_* and its value, which for ACCEPTED and CONNECTED is the connection's file descriptor.
struct ZmqEvent {
  int type = 0;
  int value = 0;
};

enum class ZmqSend { kSent, kWouldBlock, kNoRoute };

class ZmqSocket {
 public:
  // kUnavailable if there are no more files or sockets.
  static Result<ZmqSocket> Make(const ZmqContext& context, int type);

  // The option exists and takes this value, else the program is wrong.
  void Set(int option, int value);
  void SetInt64(int option, std::int64_t value);
  void Set(int option, const std::string& value);

  // kUnavailable: "Address already in use" and the like.
  Result<void> Bind(const std::string& endpoint);
  // No longer; those that are connected stay. libzmq closes in its own time, and takes the file of an ipc socket away.
  void Unbind(const std::string& endpoint);
  Result<void> Connect(const std::string& endpoint);

  // A socket that reports what becomes of this one's connections, from now on: ZMQ_EVENT_* of `events`. `endpoint` is
  // inproc and not used before. Close it after this one.
  Result<ZmqSocket> MakeMonitor(const ZmqContext& context, const std::string& endpoint, int events);
  // Of a monitor: returns the next event; none if nothing waits.
  std::optional<ZmqEvent> ReceiveEvent();

  // Never block; false if nothing waits. Of the parts of a message, at most kPartsMax are kept.
  bool Receive(std::vector<ZmqFrame>* parts);
  bool Receive(ZmqReceived* message);
  static constexpr std::size_t kPartsMax = 8;

  // Never blocks. What was sent is empty afterwards; kWouldBlock and kNoRoute leave the (first) frame as it was.
  ZmqSend Send(ZmqFrame* frame, bool has_more = false);

  // Handles libzmq's own commands to this socket; for one that is not read from.
  void Process();

  // Readable when libzmq has something new for this socket: then it has to be received from until nothing waits, or
  // Process; only after that does the file announce anything newer.
  int file() const { return file_; }

 private:
  struct Closer {
    void operator()(void* socket) const;
  };
  void* get() const { return socket_.get(); }
  bool ReceiveFrame(ZmqFrame* frame, int flags);

  std::unique_ptr<void, Closer> socket_;
  int type_ = 0;  // ZMQ_ROUTER, ...
  int file_ = -1;
};

}  // namespace moondb
