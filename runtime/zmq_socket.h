// ZmqSocket: one libzmq socket, owned. libzmq's context and socket calls, without exceptions.
//
// Not thread-safe: one thread at a time.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

struct ZmqContextDeleter {
  void operator()(void* context) const;
};
// Destroy after all of its sockets: it waits for them.
using ZmqContext = std::unique_ptr<void, ZmqContextDeleter>;

ZmqContext MakeZmqContext(int io_threads);

struct ZmqParts {
  std::vector<std::string> parts;  // At most kZmqPartsMax; further ones are read and forgotten.
  std::size_t count = 0;           // As received.
  std::string user_id;             // What the ZAP handler gave the sender; empty without CURVE.
};
inline constexpr std::size_t kZmqPartsMax = 8;

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
  Result<void> Connect(const std::string& endpoint);

  // ZMQ_EVENT_* to inproc `endpoint`, for a PAIR socket of the same context.
  Result<void> Monitor(const std::string& endpoint, int events);

  // False if nothing waits. Never blocks.
  bool Receive(ZmqParts* message);
  // Never blocks.
  ZmqSend Send(const std::vector<const std::string*>& parts);

  // Handles libzmq's own commands to this socket; for one that is not polled.
  void Process();

  void* get() const { return socket_.get(); }

 private:
  struct Closer {
    void operator()(void* socket) const;
  };
  std::unique_ptr<void, Closer> socket_;
};

}  // namespace moondb
