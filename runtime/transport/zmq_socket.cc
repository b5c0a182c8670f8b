#include "runtime/transport/zmq_socket.h"

#include <sys/random.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "model/check.h"

namespace moondb {
namespace {

// Repeats a call that a signal interrupted. An interrupted call has had no effect.
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
  static const bool kIsSeeded = [] {
    unsigned seed = 0;
    Check(::getrandom(&seed, sizeof seed, 0) == sizeof seed, "the system gives random numbers");
    std::srand(seed);
    return true;
  }();
  Check(kIsSeeded, "rand() is seeded");
  ZmqContext context(zmq_ctx_new());
  Check(context != nullptr, "libzmq makes a context");
  Check(zmq_ctx_set(context.get(), ZMQ_IO_THREADS, io_threads) == 0, "a number of threads that libzmq takes");
  return context;
}

ZmqFrame::ZmqFrame(std::size_t size) {
  Check(zmq_msg_init_size(&message_, size) == 0, "the system gives memory for a frame");
}

ZmqFrame::ZmqFrame(std::string_view text) : ZmqFrame(text.size()) { std::memcpy(data(), text.data(), text.size()); }

std::string_view ZmqFrame::text() const { return {static_cast<const char*>(zmq_msg_data(&message_)), size()}; }

std::string_view ZmqFrame::user_id() const {
  const char* user_id = zmq_msg_gets(&message_, "User-Id");
  return user_id == nullptr ? std::string_view() : std::string_view(user_id);
}

void ZmqSocket::Closer::operator()(void* socket) const {
  // Stop the monitor first. A last event could otherwise block libzmq's thread forever, if the monitor's reader is
  // closed too.
  (void)zmq_socket_monitor(socket, nullptr, 0);
  (void)zmq_close(socket);
}

Result<ZmqSocket> ZmqSocket::Make(const ZmqContext& context, int type) {
  ZmqSocket socket;
  socket.socket_.reset(zmq_socket(context.get(), type));
  socket.type_ = type;
  if (socket.socket_ == nullptr) {
    return Fail(ErrorCode::kUnavailable, std::string("cannot make a socket: ") + zmq_strerror(zmq_errno()));
  }
  // Unsent messages are lost when a socket closes. The sharing actors retransmit them.
  socket.Set(ZMQ_LINGER, 0);
  std::size_t size = sizeof socket.file_;
  Check(zmq_getsockopt(socket.get(), ZMQ_FD, &socket.file_, &size) == 0, "a socket has a file to wait for");
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

void ZmqSocket::Unbind(const std::string& endpoint) { (void)zmq_unbind(get(), endpoint.c_str()); }

Result<void> ZmqSocket::Connect(const std::string& endpoint) {
  if (zmq_connect(get(), endpoint.c_str()) == 0) return {};
  return Fail(ErrorCode::kUnavailable, "cannot connect to " + endpoint + ": " + zmq_strerror(zmq_errno()));
}

Result<ZmqSocket> ZmqSocket::MakeMonitor(const ZmqContext& context, const std::string& endpoint, int events) {
  Result<ZmqSocket> monitor = Make(context, ZMQ_PAIR);
  if (!monitor) return monitor;
  if (zmq_socket_monitor(get(), endpoint.c_str(), events) != 0) {
    return Fail(ErrorCode::kUnavailable, std::string("cannot watch a socket: ") + zmq_strerror(zmq_errno()));
  }
  if (const auto joined = monitor->Connect(endpoint); !joined) return tl::unexpected(joined.error());
  // The descriptor signals events only after a receive has found the socket empty.
  (void)monitor->ReceiveEvent();
  return monitor;
}

// An event message has two frames: the event's number and value, and the endpoint.
std::optional<ZmqEvent> ZmqSocket::ReceiveEvent() {
  std::vector<ZmqFrame> parts;
  if (!Receive(&parts)) return std::nullopt;
  std::uint16_t type = 0;
  std::uint32_t value = 0;
  Check(parts[0].size() == sizeof type + sizeof value, "a monitor's event has a type and a value");
  std::memcpy(&type, parts[0].data(), sizeof type);
  std::memcpy(&value, parts[0].data() + sizeof type, sizeof value);
  return ZmqEvent{type, static_cast<int>(value)};
}

bool ZmqSocket::ReceiveFrame(ZmqFrame* frame, int flags) {
  return Uninterrupted([&] { return zmq_msg_recv(&frame->message_, get(), flags); }) >= 0;
}

// All parts of a message arrive together: only the first one can be missing.
bool ZmqSocket::Receive(std::vector<ZmqFrame>* parts) {
  parts->clear();
  ZmqFrame frame;
  if (!ReceiveFrame(&frame, ZMQ_DONTWAIT)) return false;
  bool has_more = true;
  while (has_more) {
    has_more = zmq_msg_more(&frame.message_) != 0;
    if (parts->size() < kPartsMax) parts->push_back(std::move(frame));
    if (has_more && !ReceiveFrame(&frame, 0)) return false;
  }
  return true;
}

// libzmq provides the file descriptor with the last part only.
bool ZmqSocket::Receive(ZmqReceived* message) {
  message->route = {};
  message->parts = 0;
  message->file = -1;
  int flags = ZMQ_DONTWAIT;  // All parts arrive together: only the first one can be missing.
  if (type_ == ZMQ_ROUTER) {
    if (!ReceiveFrame(&message->route, flags)) return false;
    if (zmq_msg_more(&message->route.message_) == 0) return true;
    flags = 0;
  }
  for (bool has_more = true; has_more; ++message->parts) {
    ZmqFrame further;
    ZmqFrame& part = message->parts == 0 ? message->frame : further;
    if (!ReceiveFrame(&part, flags)) return false;
    flags = 0;
    message->file = zmq_msg_get(&part.message_, ZMQ_SRCFD);
    has_more = zmq_msg_more(&part.message_) != 0;
  }
  return true;
}

ZmqSend ZmqSocket::Send(ZmqFrame* frame, bool has_more) {
  const int flags = ZMQ_DONTWAIT | (has_more ? ZMQ_SNDMORE : 0);
  if (Uninterrupted([&] { return zmq_msg_send(&frame->message_, get(), flags); }) >= 0) return ZmqSend::kSent;
  return zmq_errno() == EAGAIN ? ZmqSend::kWouldBlock : ZmqSend::kNoRoute;
}

void ZmqSocket::Process() {
  int events = 0;
  std::size_t size = sizeof events;
  (void)zmq_getsockopt(get(), ZMQ_EVENTS, &events, &size);
}

}  // namespace moondb
