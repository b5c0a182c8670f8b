#include "client/connection.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <zmq.hpp>

namespace moondb {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::string_view kIpc = "ipc://";
// How often a wait for an answer looks whether the agent is still there.
constexpr std::chrono::milliseconds kLivenessPeriod(100);

// libzmq retries an absent ipc peer silently; a plain connect tells at once. `error` is an errno, 0 for a listener.
int ProbeSocket(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) return ENAMETOOLONG;
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (probe < 0) return errno;
  const int error = ::connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 ? 0 : errno;
  ::close(probe);
  return error == EAGAIN ? 0 : error;  // A full backlog is a listener too.
}

Result<void> CheckListener(const std::string& endpoint, const std::string& agent_name) {
  if (!endpoint.starts_with(kIpc)) return {};
  const std::string path = endpoint.substr(kIpc.size());
  const std::string absent = "agent " + agent_name + " is not running (";
  switch (const int error = ProbeSocket(path)) {
    case 0:
      return {};
    case ENOENT:
      return Fail(ErrorCode::kUnavailable, absent + "no socket " + path + ")");
    case ECONNREFUSED:
      return Fail(ErrorCode::kUnavailable, absent + "nobody listens at " + path + ")");
    default:
      return Fail(ErrorCode::kUnavailable, "agent " + agent_name + ": " + path + ": " + std::strerror(error));
  }
}

std::chrono::milliseconds Until(SteadyClock::time_point deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - SteadyClock::now());
  return std::max(left, std::chrono::milliseconds(0));
}

}  // namespace

struct Client::Connection::Sockets {
  zmq::context_t context;
  zmq::socket_t dealer{context, zmq::socket_type::dealer};

  bool is_writable() { return (dealer.get(zmq::sockopt::events) & ZMQ_POLLOUT) != 0; }
  // A signal of the user's program does not end the wait.
  bool Poll(short events, std::chrono::milliseconds timeout) {
    const auto deadline = SteadyClock::now() + timeout;
    while (true) {
      zmq::pollitem_t item{dealer.handle(), 0, events, 0};
      const int ready = zmq_poll(&item, 1, static_cast<long>(Until(deadline).count()));
      if (ready >= 0) return ready > 0;
      if (zmq_errno() != EINTR) throw zmq::error_t();
    }
  }
};

Client::Connection::Connection(std::string endpoint, std::string agent_name, std::size_t message_bytes_max)
    : endpoint_(std::move(endpoint)), agent_name_(std::move(agent_name)), message_bytes_max_(message_bytes_max) {}

Client::Connection::~Connection() { Close(); }

void Client::Connection::Close() { sockets_.reset(); }

Result<void> Client::Connection::Open(Duration timeout) {
  if (sockets_ != nullptr && sockets_->is_writable()) return {};
  Close();
  if (auto listening = CheckListener(endpoint_, agent_name_); !listening) return listening;
  try {
    auto sockets = std::make_unique<Sockets>();
    sockets->dealer.set(zmq::sockopt::linger, 0);
    sockets->dealer.set(zmq::sockopt::immediate, true);    // Writable only when somebody is there.
    sockets->dealer.set(zmq::sockopt::reconnect_ivl, -1);  // A lost connection is never taken up silently.
    sockets->dealer.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(message_bytes_max_));
    sockets->dealer.connect(endpoint_);
    if (!sockets->Poll(ZMQ_POLLOUT, timeout)) {
      return Fail(ErrorCode::kUnavailable, "agent " + agent_name_ + " does not answer at " + endpoint_);
    }
    sockets_ = std::move(sockets);
    return {};
  } catch (const zmq::error_t& error) {
    return Fail(ErrorCode::kUnavailable, "agent " + agent_name_ + " at " + endpoint_ + ": " + error.what());
  }
}

Result<void> Client::Connection::Send(const std::string& frame) {
  try {
    if (sockets_->dealer.send(zmq::buffer(frame), zmq::send_flags::dontwait)) return {};
  } catch (const zmq::error_t&) {
  }
  Close();
  return Fail(ErrorCode::kUnavailable, "agent " + agent_name_ + " went away");
}

Result<std::string> Client::Connection::Receive(SteadyClock::time_point deadline) {
  try {
    zmq::message_t frame;
    while (true) {
      if (sockets_->dealer.recv(frame, zmq::recv_flags::dontwait)) {
        // Only single frames are answers; what else comes is not ours.
        if (!frame.more()) return frame.to_string();
        continue;
      }
      if (!sockets_->is_writable()) {
        Close();
        return Fail(ErrorCode::kUnavailable, "agent " + agent_name_ + " went away during the call");
      }
      const auto left = Until(deadline);
      if (left.count() == 0) return Fail(ErrorCode::kTimedOut, "agent " + agent_name_ + " did not answer in time");
      sockets_->Poll(ZMQ_POLLIN, std::min(left, kLivenessPeriod));
    }
  } catch (const zmq::error_t& error) {
    Close();
    return Fail(ErrorCode::kUnavailable, "agent " + agent_name_ + ": " + error.what());
  }
}

}  // namespace moondb
