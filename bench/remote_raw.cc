#include "bench/remote_raw.h"

#include <zmq.h>

#include <array>
#include <cstring>
#include <optional>
#include <string>
#include <thread>

#include "bench/measure.h"
#include "bench/tally.h"
#include "model/check.h"
#include "runtime/team/curve_keys.h"

namespace moondb {
namespace {

constexpr int kPatience_ms = 120'000;

class RawAgent {
 public:
  RawAgent(RawSockets sockets, bool is_curve, std::size_t bytes)
      : sockets_(sockets),
        bytes_(bytes),
        context_(zmq_ctx_new()),
        listener_(Make(TypeOfListener(sockets, is_curve))),
        dealer_(Make(ZMQ_DEALER)) {
    if (is_curve) keys_ = MakeCurveKeys().value();
    if (sockets_ == RawSockets::kAsMoondb) SetUpAsMoondb();
    if (keys_) {
      Set(listener_, ZMQ_CURVE_SERVER, 1);
      Set(listener_, ZMQ_CURVE_SECRETKEY, keys_->secret_key);
    }
    Check(zmq_bind(listener_, "tcp://127.0.0.1:*") == 0, "loopback has a free port");
  }

  ~RawAgent() {
    zmq_close(dealer_);
    zmq_close(listener_);
    zmq_ctx_term(context_);
  }

  RawAgent(const RawAgent&) = delete;
  RawAgent& operator=(const RawAgent&) = delete;

  void Connect(const RawAgent& other) {
    if (keys_) {
      Set(dealer_, ZMQ_CURVE_SERVERKEY, other.keys_->public_key);
      Set(dealer_, ZMQ_CURVE_PUBLICKEY, keys_->public_key);
      Set(dealer_, ZMQ_CURVE_SECRETKEY, keys_->secret_key);
    }
    std::array<char, 64> endpoint{};
    std::size_t size = endpoint.size();
    Check(zmq_getsockopt(other.listener_, ZMQ_LAST_ENDPOINT, endpoint.data(), &size) == 0,
          "a bound socket has its name");
    Check(zmq_connect(dealer_, endpoint.data()) == 0, "loopback is there");
  }

  // Returns false if the frame could not be sent within kPatience_ms.
  bool Send(std::uint64_t id) {
    zmq_msg_t frame;
    zmq_msg_init_size(&frame, bytes_);
    auto* data = static_cast<char*>(zmq_msg_data(&frame));
    std::memset(data, 'x', bytes_);
    std::memcpy(data, &id, sizeof id);
    if (zmq_msg_send(&frame, dealer_, 0) >= 0) return true;
    zmq_msg_close(&frame);
    return false;
  }

  // Returns null if no frame arrives within kPatience_ms.
  std::optional<std::uint64_t> Receive() {
    zmq_msg_t frame;
    zmq_msg_init(&frame);
    std::optional<std::uint64_t> id;
    // A ROUTER socket puts the connection's id in front of the frame. Skip the id.
    const bool has_route = TypeOfListener(sockets_, keys_.has_value()) == ZMQ_ROUTER;
    if (has_route && zmq_msg_recv(&frame, listener_, 0) < 0) return id;
    if (zmq_msg_recv(&frame, listener_, 0) == static_cast<int>(bytes_)) {
      std::memcpy(&id.emplace(), zmq_msg_data(&frame), sizeof *id);
    }
    zmq_msg_close(&frame);
    return id;
  }

 private:
  static int TypeOfListener(RawSockets sockets, bool is_curve) {
    return sockets == RawSockets::kAsMoondb && is_curve ? ZMQ_DEALER : ZMQ_ROUTER;
  }

  void* Make(int type) {
    void* socket = zmq_socket(context_, type);
    Check(socket != nullptr, "there are sockets");
    Set(socket, ZMQ_SNDTIMEO, kPatience_ms);
    Set(socket, ZMQ_RCVTIMEO, kPatience_ms);
    return socket;
  }

  // Sets the same socket options as runtime/transport/peer_link.cc and runtime/transport/zeromq_transport.cc.
  void SetUpAsMoondb() {
    for (void* socket : {dealer_, listener_}) {
      Set(socket, ZMQ_LINGER, 0);
      const std::int64_t bytes_max = 32 * 1024 * 1024;
      Check(zmq_setsockopt(socket, ZMQ_MAXMSGSIZE, &bytes_max, sizeof bytes_max) == 0, "libzmq knows the option");
    }
    Set(dealer_, ZMQ_IMMEDIATE, 1);
    Set(dealer_, ZMQ_SNDHWM, 2000);
    Set(dealer_, ZMQ_RCVHWM, 1);
    Set(dealer_, ZMQ_RECONNECT_IVL, 100);
    Set(dealer_, ZMQ_RECONNECT_IVL_MAX, 4000);
    Set(dealer_, ZMQ_CONNECT_TIMEOUT, 5000);
    Set(dealer_, ZMQ_TCP_MAXRT, 15000);
    Set(dealer_, ZMQ_ROUTING_ID, std::string("1"));
    if (!keys_) Set(listener_, ZMQ_ROUTER_HANDOVER, 1);
    Set(listener_, ZMQ_RCVHWM, 256);
    Set(listener_, ZMQ_SNDHWM, 1);
  }

  static void Set(void* socket, int option, int value) {
    Check(zmq_setsockopt(socket, option, &value, sizeof value) == 0, "libzmq knows the option");
  }
  static void Set(void* socket, int option, const std::string& value) {
    Check(zmq_setsockopt(socket, option, value.data(), value.size()) == 0, "libzmq knows the option");
  }

  const RawSockets sockets_;
  const std::size_t bytes_;
  void* const context_;
  void* const listener_;
  void* const dealer_;
  std::optional<CurveKeys> keys_;
};

Error Lost() { return {ErrorCode::kUnavailable, "a frame was lost", {}}; }

// Connects both agents, and exchanges messages in both directions to complete the handshakes. Returns false if a
// message did not arrive.
bool Meet(RawAgent& a, RawAgent& b) {
  a.Connect(b);
  b.Connect(a);
  return a.Send(0) && b.Receive() && b.Send(0) && a.Receive();
}

}  // namespace

Result<double> RawThroughput(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count) {
  RawAgent sender(sockets, is_curve, bytes);
  RawAgent receiver(sockets, is_curve, bytes);
  if (!Meet(sender, receiver)) return tl::unexpected(Lost());
  Tally tally(/*sender_count=*/1, count);
  const auto start = BenchClock::now();
  std::thread reader([&] {
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::optional<std::uint64_t> id = receiver.Receive();
      if (!id) return tally.Fail("a frame was lost");
      tally.Count(*id);
    }
  });
  RunSenders(1, [&](int) {
    for (std::uint64_t number = 0; number < count; ++number) {
      if (!sender.Send(number)) return;
    }
  });
  const Result<void> done = tally.Wait();
  const auto took = BenchClock::now() - start;
  reader.join();
  if (!done) return tl::unexpected(done.error());
  return PerSecond(count, took);
}

Result<double> RawRoundTrip(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count) {
  RawAgent ping(sockets, is_curve, bytes);
  RawAgent pong(sockets, is_curve, bytes);
  if (!Meet(ping, pong)) return tl::unexpected(Lost());
  std::thread other([&] {
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::optional<std::uint64_t> id = pong.Receive();
      if (!id || !pong.Send(*id)) return;
    }
  });
  const auto start = BenchClock::now();
  bool is_complete = true;
  for (std::uint64_t i = 0; i < count && is_complete; ++i) is_complete = ping.Send(i) && ping.Receive() == i;
  const auto took = BenchClock::now() - start;
  other.join();
  if (!is_complete) return tl::unexpected(Lost());
  return MicrosecondsEach(count, took);
}

}  // namespace moondb
