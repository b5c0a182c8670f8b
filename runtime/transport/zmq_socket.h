// ZmqSocket, ZmqFrame: own a libzmq socket and a libzmq message. They throw no exceptions.
//
// Not thread-safe. Another thread may take over a socket after synchronisation with a lock.
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
// Owns a libzmq context. Destruction waits until all sockets of the context are closed.
using ZmqContext = std::unique_ptr<void, ZmqContextDeleter>;

// Creates a context. Also seeds rand() from system entropy, once per process. The first routing id of each ROUTER comes
// from rand(). A client that claims the id that a ROUTER assigns next makes libzmq abort the process.
ZmqContext MakeZmqContext(int io_threads);

// A message part in libzmq's memory, which sending and receiving do not copy.
class ZmqFrame {
 public:
  ZmqFrame() { zmq_msg_init(&message_); }
  explicit ZmqFrame(std::size_t size);  // Uninitialised; write through data().
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
  // Returns the User-Id that the ZAP handler set for the sender; empty without CURVE.
  std::string_view user_id() const;

 private:
  friend class ZmqSocket;
  mutable zmq_msg_t message_;  // Mutable because libzmq reads it through non-const pointers.
};

struct ZmqReceived {
  ZmqFrame route;         // Routing id that a ROUTER puts before the message; empty from other sockets.
  ZmqFrame frame;         // First part of the message. Further parts are read and dropped.
  std::size_t parts = 0;  // Number of parts, without the route.
  int file = -1;          // Descriptor of the message's connection. The kernel may have reused it since.
};

// Time limit for the handshake of an incoming connection.
inline constexpr int kHandshakeMax_ms = 2000;

// A monitor's event: a ZMQ_EVENT_* and its value. For ACCEPTED and CONNECTED the value is the connection's descriptor.
struct ZmqEvent {
  int type = 0;
  int value = 0;
};

enum class ZmqSend { kSent, kWouldBlock, kNoRoute };

class ZmqSocket {
 public:
  // Creates a socket. Returns kUnavailable if no more files or sockets can be opened.
  static Result<ZmqSocket> Make(const ZmqContext& context, int type);

  // Sets an option. Fails a Check if libzmq rejects the option or its value.
  void Set(int option, int value);
  void SetInt64(int option, std::int64_t value);
  void Set(int option, const std::string& value);

  // Returns kUnavailable for errors such as "Address already in use".
  Result<void> Bind(const std::string& endpoint);
  // Stops listening; existing connections stay open. libzmq stops asynchronously. Some versions then delete the file of
  // an ipc socket; 4.3.4 does not.
  void Unbind(const std::string& endpoint);
  Result<void> Connect(const std::string& endpoint);

  // Creates a socket that reports the events `events` (ZMQ_EVENT_*) that occur after this call on this socket's
  // connections. `endpoint` must be an unused inproc endpoint. Close the monitor after this
  // socket: an event that nobody can receive blocks the thread of libzmq.
  Result<ZmqSocket> MakeMonitor(const ZmqContext& context, const std::string& endpoint, int events);
  // Returns the next event of a monitor, or nothing if none waits.
  std::optional<ZmqEvent> ReceiveEvent();

  // Receive the next message without blocking. Return false if none waits. The first overload keeps at most kPartsMax
  // parts and drops all others.
  bool Receive(std::vector<ZmqFrame>* parts);
  bool Receive(ZmqReceived* message);
  static constexpr std::size_t kPartsMax = 8;

  // Sends a frame without blocking. Returns kSent and empties the frame, or leaves it unchanged: kWouldBlock if the
  // queue is full, kNoRoute for other errors, such as an unknown routing id. `has_more`: another part of the message
  // follows.
  ZmqSend Send(ZmqFrame* frame, bool has_more = false);

  // Handles libzmq's internal commands. Needed for a socket on which Receive is never called.
  void Process();

  // Descriptor that becomes readable when libzmq has events for this socket. Then call Process, or Receive until it
  // returns false. Until then, the descriptor signals no further events.
  int file() const { return file_; }

 private:
  struct Closer {
    void operator()(void* socket) const;
  };
  void* get() const { return socket_.get(); }
  bool ReceiveFrame(ZmqFrame* frame, int flags);

  std::unique_ptr<void, Closer> socket_;
  int type_ = 0;  // Type, such as ZMQ_ROUTER.
  int file_ = -1;
};

}  // namespace moondb
