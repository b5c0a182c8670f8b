#include "client/connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>
#include <zmq.hpp>

#include "model/curve_key.h"
#include "model/local_socket.h"
#include "model/tcp_info.h"

namespace moondb {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::string_view kIpc = "ipc://";
// How often a wait for a reply checks that the agent is still connected.
constexpr std::chrono::milliseconds kLivenessPeriod(100);
// How often a wait for the connection checks whether the handshake has failed.
constexpr std::chrono::milliseconds kHandshakePeriod(20);

Result<void> CheckListener(const std::string& endpoint, const std::string& agent_name) {
  if (!endpoint.starts_with(kIpc)) return {};
  const std::string path = endpoint.substr(kIpc.size());
  const std::string absent = "agent " + agent_name + " is not running (";
  switch (const int error = ProbeLocalSocket(path)) {
    case 0:
      return {};
    case ENOENT:
      return Fail(ErrorCode::kUnavailable, absent + "no socket " + path + ")");
    case ECONNREFUSED:
      return Fail(ErrorCode::kUnavailable, absent + "no process listens at " + path + ")");
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
  zmq::socket_t monitor{context, zmq::socket_type::pair};  // Receives connection events of `dealer`.
  int file = -1;                                           // File descriptor of the connection; -1: not connected.

  void Watch() {
    constexpr char kMonitor[] = "inproc://monitor";
    constexpr int kEvents = ZMQ_EVENT_CONNECTED | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH |
                            ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL |
                            ZMQ_EVENT_DISCONNECTED | ZMQ_EVENT_CLOSED;
    if (zmq_socket_monitor(dealer.handle(), kMonitor, kEvents) != 0) throw zmq::error_t();
    monitor.set(zmq::sockopt::linger, 0);
    monitor.connect(kMonitor);
  }
  // Returns the next event of `monitor`; 0 if there is none. Does not return ZMQ_EVENT_CONNECTED, but stores the
  // event's file descriptor in `file`.
  int NextEvent() {
    zmq::message_t event;
    zmq::message_t address;
    while (monitor.recv(event, zmq::recv_flags::dontwait) && monitor.recv(address, zmq::recv_flags::none)) {
      std::uint16_t number = 0;
      std::int32_t value = 0;
      std::memcpy(&number, event.data(), sizeof(number));
      std::memcpy(&value, static_cast<const char*>(event.data()) + sizeof(number), sizeof(value));
      if (number != ZMQ_EVENT_CONNECTED) return number;
      file = value;
    }
    return 0;
  }

  // Returns the number of bytes received over this TCP connection; 0 for other transports.
  std::uint64_t ReceivedBytes() const {
    const std::optional<TcpInfo> info = ReadTcpInfo(file);
    return info ? info->bytes_received.value_or(0) : 0;
  }

  bool is_writable() { return (dealer.get(zmq::sockopt::events) & ZMQ_POLLOUT) != 0; }
  // Waits for `events`. Returns false after `timeout`. A signal (EINTR) does not end the wait.
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

Client::Connection::Connection(std::string endpoint, std::string agent_name, const Options& options)
    : endpoint_(std::move(endpoint)),
      agent_name_(std::move(agent_name)),
      message_bytes_max_(options.message_bytes_max),
      server_key_(options.server_key),
      secret_key_(options.secret_key) {}

Client::Connection::~Connection() { Close(); }

void Client::Connection::Close() { sockets_.reset(); }

Result<void> Client::Connection::Open(Duration timeout) {
  if (sockets_ != nullptr && sockets_->is_writable()) return {};
  Close();
  if (auto listening = CheckListener(endpoint_, agent_name_); !listening) return listening;
  try {
    auto sockets = std::make_unique<Sockets>();
    sockets->dealer.set(zmq::sockopt::linger, 0);
    sockets->dealer.set(zmq::sockopt::immediate, true);    // Writable only while connected.
    sockets->dealer.set(zmq::sockopt::reconnect_ivl, -1);  // Never reconnect silently.
    sockets->dealer.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(message_bytes_max_));
    if (auto keyed = UseKeys(*sockets); !keyed) return keyed;
    sockets->Watch();
    sockets->dealer.connect(endpoint_);
    if (auto there = WaitForPeer(*sockets, timeout); !there) return there;
    (void)sockets->NextEvent();  // Sets `file` to the connection's descriptor.
    sockets_ = std::move(sockets);
    return {};
  } catch (const zmq::error_t& error) {
    return Fail(ErrorCode::kUnavailable, "agent " + agent_name_ + " at " + endpoint_ + ": " + error.what());
  }
}

Result<void> Client::Connection::UseKeys(Sockets& sockets) const {
  if (secret_key_.empty()) return {};
  std::array<char, kCurveKeyLength + 1> public_key{};
  if (server_key_.size() != kCurveKeyLength || secret_key_.size() != kCurveKeyLength ||
      zmq_curve_public(public_key.data(), secret_key_.c_str()) != 0) {
    return Fail(ErrorCode::kInvalid, "expected keys of 40 characters in Z85", "secret_key");
  }
  sockets.dealer.set(zmq::sockopt::curve_serverkey, server_key_);
  sockets.dealer.set(zmq::sockopt::curve_publickey, std::string(public_key.data()));
  sockets.dealer.set(zmq::sockopt::curve_secretkey, secret_key_);
  return {};
}

Result<void> Client::Connection::WaitForPeer(Sockets& sockets, Duration timeout) const {
  const auto deadline = SteadyClock::now() + timeout;
  const std::string agent = "agent " + agent_name_;
  while (!sockets.Poll(ZMQ_POLLOUT, std::min(Until(deadline), kHandshakePeriod))) {
    switch (sockets.NextEvent()) {
      case 0:
        break;
      case ZMQ_EVENT_HANDSHAKE_FAILED_AUTH:
        return Fail(ErrorCode::kRefused, agent + " does not admit this key: add the key with moonctl clients add");
      default:
        return Fail(ErrorCode::kUnavailable,
                    agent + " does not listen at " + endpoint_ + ", or has another key than expected");
    }
    if (SteadyClock::now() >= deadline) {
      return Fail(ErrorCode::kUnavailable, agent + " does not answer at " + endpoint_);
    }
  }
  return {};
}

Result<void> Client::Connection::Send(const std::string& frame) {
  try {
    if (sockets_->dealer.send(zmq::buffer(frame), zmq::send_flags::dontwait)) return {};
  } catch (const zmq::error_t&) {
  }
  Close();
  return Fail(ErrorCode::kUnavailable, "agent " + agent_name_ + " disconnected");
}

Result<std::string> Client::Connection::Receive(SteadyClock::time_point deadline) {
  try {
    zmq::message_t frame;
    const std::uint64_t received_before = sockets_->ReceivedBytes();
    while (true) {
      if (sockets_->dealer.recv(frame, zmq::recv_flags::dontwait)) {
        // A reply is a single frame. Skip the frames of multipart messages.
        if (!frame.more()) return frame.to_string();
        continue;
      }
      if (!sockets_->is_writable()) {
        Close();
        return Fail(ErrorCode::kUnavailable, "agent " + agent_name_ + " disconnected during the call");
      }
      // maxmsgsize limits the size of a frame. Limit the number of frames of a message, too, because libzmq buffers
      // them all.
      if (sockets_->ReceivedBytes() > received_before + 2 * message_bytes_max_) {
        Close();
        return Fail(
            ErrorCode::kCorrupt,
            "agent " + agent_name_ + " sent a message that is too long, and was disconnected: check its version");
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
