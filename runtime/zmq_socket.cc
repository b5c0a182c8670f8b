#include "runtime/zmq_socket.h"

#include <zmq.h>

#include <cerrno>
#include <cstdint>

#include "model/check.h"

namespace moondb {
namespace {

// A message that is closed on every way out.
class Part {
 public:
  Part() { zmq_msg_init(&message_); }
  ~Part() { zmq_msg_close(&message_); }
  Part(const Part&) = delete;
  Part& operator=(const Part&) = delete;
  zmq_msg_t* get() { return &message_; }
  std::string Text() { return {static_cast<const char*>(zmq_msg_data(&message_)), zmq_msg_size(&message_)}; }

 private:
  zmq_msg_t message_;
};

// A signal interrupts a call before it has done anything.
template <typename Call>
int Uninterrupted(Call call) {
  int result = call();
  while (result < 0 && zmq_errno() == EINTR) result = call();
  return result;
}

}  // namespace

void ZmqContextDeleter::operator()(void* context) const {
  (void)Uninterrupted([&] { return zmq_ctx_term(context); });
}

ZmqContext MakeZmqContext(int io_threads) {
  ZmqContext context(zmq_ctx_new());
  Check(context != nullptr, "libzmq makes a context");
  Check(zmq_ctx_set(context.get(), ZMQ_IO_THREADS, io_threads) == 0, "a number of threads that libzmq takes");
  return context;
}

void ZmqSocket::Closer::operator()(void* socket) const { (void)zmq_close(socket); }

Result<ZmqSocket> ZmqSocket::Make(const ZmqContext& context, int type) {
  ZmqSocket socket;
  socket.socket_.reset(zmq_socket(context.get(), type));
  if (socket.socket_ == nullptr) {
    return Fail(ErrorCode::kUnavailable, std::string("cannot make a socket: ") + zmq_strerror(zmq_errno()));
  }
  // What has not left when a socket closes is lost; sharing sends it again.
  socket.Set(ZMQ_LINGER, 0);
  return socket;
}

void ZmqSocket::Set(int option, int value) {
  Check(zmq_setsockopt(get(), option, &value, sizeof value) == 0, "a socket option that libzmq takes");
}

void ZmqSocket::SetInt64(int option, std::int64_t value) {
  Check(zmq_setsockopt(get(), option, &value, sizeof value) == 0, "a socket option that libzmq takes");
}

void ZmqSocket::Set(int option, const std::string& value) {
  Check(zmq_setsockopt(get(), option, value.data(), value.size()) == 0, "a socket option that libzmq takes");
}

Result<void> ZmqSocket::Bind(const std::string& endpoint) {
  if (zmq_bind(get(), endpoint.c_str()) == 0) return {};
  return Fail(ErrorCode::kUnavailable, "cannot listen on " + endpoint + ": " + zmq_strerror(zmq_errno()));
}

Result<void> ZmqSocket::Connect(const std::string& endpoint) {
  if (zmq_connect(get(), endpoint.c_str()) == 0) return {};
  return Fail(ErrorCode::kUnavailable, "cannot connect to " + endpoint + ": " + zmq_strerror(zmq_errno()));
}

Result<void> ZmqSocket::Monitor(const std::string& endpoint, int events) {
  if (zmq_socket_monitor(get(), endpoint.c_str(), events) == 0) return {};
  return Fail(ErrorCode::kUnavailable, std::string("cannot watch a socket: ") + zmq_strerror(zmq_errno()));
}

bool ZmqSocket::Receive(ZmqParts* message) {
  *message = {};
  bool has_more = true;
  while (has_more) {
    Part part;
    const int flags = message->count == 0 ? ZMQ_DONTWAIT : 0;  // The parts of a message come together.
    if (Uninterrupted([&] { return zmq_msg_recv(part.get(), get(), flags); }) < 0) return false;
    if (message->count < kZmqPartsMax) message->parts.push_back(part.Text());
    ++message->count;
    has_more = zmq_msg_more(part.get()) != 0;
    if (has_more) continue;
    const char* user_id = zmq_msg_gets(part.get(), "User-Id");
    if (user_id != nullptr) message->user_id = user_id;
  }
  return true;
}

ZmqSend ZmqSocket::Send(const std::vector<const std::string*>& parts) {
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const int flags = ZMQ_DONTWAIT | (i + 1 < parts.size() ? ZMQ_SNDMORE : 0);
    const int sent = Uninterrupted([&] { return zmq_send(get(), parts[i]->data(), parts[i]->size(), flags); });
    if (sent < 0) return zmq_errno() == EAGAIN ? ZmqSend::kWouldBlock : ZmqSend::kNoRoute;
  }
  return ZmqSend::kSent;
}

void ZmqSocket::Process() {
  int events = 0;
  std::size_t size = sizeof events;
  (void)zmq_getsockopt(get(), ZMQ_EVENTS, &events, &size);
}

}  // namespace moondb
