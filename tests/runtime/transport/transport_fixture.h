// A fixture for tests of the transport: real transports in one process over ipc:// in a temporary folder, and raw
// sockets that break the protocol.
#pragma once

#include <gtest/gtest.h>
#include <zmq.h>

#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "model/team_member.h"
#include "proto/status.pb.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/team_config.h"
#include "runtime/transport/outbound.h"
#include "runtime/transport/zeromq_transport.h"
#include "tests/temporary_folder.h"

namespace moondb {

// Longest wait for an event. A passing test never waits that long, even on a loaded machine.
inline constexpr std::chrono::seconds kPatience(60);

// Collects the messages and peer changes of a transport, and waits for them up to kPatience. Thread-safe.
class Ear {
 public:
  ZeroMqTransport::Deliver deliver() {
    return [this](OwnedMessage message) {
      const std::lock_guard lock(mutex_);
      messages_.push_back(std::move(message));
      changed_.notify_all();
    };
  }

  ZeroMqTransport::PeerChanged peer_changed() {
    return [this](AgentId peer, bool is_connected) {
      const std::lock_guard lock(mutex_);
      is_connected_[peer] = is_connected;
      ++(is_connected ? times_connected_ : times_lost_)[peer];
      changed_.notify_all();
    };
  }

  // Waits for the next message and returns it. Returns null if none arrives within kPatience.
  OwnedMessage Take() {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, kPatience, [&] { return !messages_.empty(); })) return nullptr;
    OwnedMessage message = std::move(messages_.front());
    messages_.pop_front();
    return message;
  }

  bool WaitForPeer(AgentId peer, bool is_connected) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kPatience, [&] {
      const auto known = is_connected_.find(peer);
      return known != is_connected_.end() && known->second == is_connected;
    });
  }

  bool WaitUntilConnected(AgentId peer, int times) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kPatience, [&] { return times_connected_[peer] >= times; });
  }

  // Waits until the peer was lost at least once, even if it is connected again. Returns false after kPatience.
  bool WaitUntilLost(AgentId peer) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kPatience, [&] { return times_lost_[peer] > 0; });
  }

  std::size_t waiting() {
    const std::lock_guard lock(mutex_);
    return messages_.size();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<OwnedMessage> messages_;
  std::map<AgentId, bool> is_connected_;
  std::map<AgentId, int> times_connected_;
  std::map<AgentId, int> times_lost_;
};

// Receives one message part. Returns nullopt if none arrives within the socket's timeout.
inline std::optional<std::string> ReceiveFrom(void* socket, int flags = 0) {
  zmq_msg_t part;
  zmq_msg_init(&part);
  std::optional<std::string> text;
  if (zmq_msg_recv(&part, socket, flags) >= 0) {
    text = std::string(static_cast<const char*>(zmq_msg_data(&part)), zmq_msg_size(&part));
  }
  zmq_msg_close(&part);
  return text;
}

// Returns a serialized PeerFrame with this link number. Requires: `messages` is a result of ToPeerFrame.
inline std::string OnLink(std::uint32_t link_number, const std::string& messages) {
  std::string frame(kLinkNumberBytes, '\0');
  WriteLinkNumber(link_number, frame.data());
  return frame + messages;
}

// A DEALER socket that bypasses moondb's transport: a client, or a peer that breaks the protocol.
class RawDealer {
 public:
  struct Keys {
    std::string server_public;
    CurveKeys own;
  };

  explicit RawDealer(const std::string& endpoint, const Keys* keys = nullptr, const std::string& routing_id = "")
      : context_(zmq_ctx_new()), socket_(zmq_socket(context_, ZMQ_DEALER)) {
    const int zero = 0;
    zmq_setsockopt(socket_, ZMQ_LINGER, &zero, sizeof zero);
    const int patience_ms = static_cast<int>(std::chrono::milliseconds(kPatience).count());
    zmq_setsockopt(socket_, ZMQ_RCVTIMEO, &patience_ms, sizeof patience_ms);
    zmq_setsockopt(socket_, ZMQ_SNDTIMEO, &patience_ms, sizeof patience_ms);
    if (!routing_id.empty()) {
      // The socket connects only once. A reconnect could take the routing id back from a newer connection.
      const int never = -1;
      zmq_setsockopt(socket_, ZMQ_RECONNECT_IVL, &never, sizeof never);
      zmq_setsockopt(socket_, ZMQ_ROUTING_ID, routing_id.data(), routing_id.size());
    }
    if (keys != nullptr) {
      zmq_setsockopt(socket_, ZMQ_CURVE_SERVERKEY, keys->server_public.c_str(), 40);
      zmq_setsockopt(socket_, ZMQ_CURVE_PUBLICKEY, keys->own.public_key.c_str(), 40);
      zmq_setsockopt(socket_, ZMQ_CURVE_SECRETKEY, keys->own.secret_key.c_str(), 40);
    }
    zmq_socket_monitor(socket_, "inproc://raw",
                       ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_HANDSHAKE_FAILED_AUTH | ZMQ_EVENT_DISCONNECTED);
    monitor_ = zmq_socket(context_, ZMQ_PAIR);
    zmq_setsockopt(monitor_, ZMQ_RCVTIMEO, &patience_ms, sizeof patience_ms);
    zmq_setsockopt(monitor_, ZMQ_LINGER, &zero, sizeof zero);
    zmq_connect(monitor_, "inproc://raw");
    EXPECT_EQ(zmq_connect(socket_, endpoint.c_str()), 0);
  }

  ~RawDealer() {
    zmq_close(socket_);
    zmq_close(monitor_);
    zmq_ctx_term(context_);
  }

  void Send(const std::string& frame, bool has_more = false) {
    EXPECT_EQ(zmq_send(socket_, frame.data(), frame.size(), has_more ? ZMQ_SNDMORE : 0),
              static_cast<int>(frame.size()));
  }

  std::string Receive() { return ReceiveFrom(socket_).value_or(""); }

  // Waits for the socket's next ZMQ_EVENT_* and returns it. Returns 0 if none arrives within kPatience.
  int NextEvent() {
    const std::optional<std::string> event = ReceiveFrom(monitor_);
    if (!event || event->size() < 2) return 0;
    (void)ReceiveFrom(monitor_);
    std::uint16_t number = 0;
    std::memcpy(&number, event->data(), sizeof number);
    return number;
  }

 private:
  void* context_;
  void* socket_;
  void* monitor_ = nullptr;
};

// A ROUTER socket that bypasses moondb's transport and CURVE: a peer that reads only when the test calls Receive.
class RawRouter {
 public:
  struct Frame {
    std::string route;
    proto::Message message;
  };

  explicit RawRouter(const std::string& endpoint) : context_(zmq_ctx_new()), socket_(zmq_socket(context_, ZMQ_ROUTER)) {
    const int zero = 0;
    const int one = 1;
    const int patience_ms = static_cast<int>(std::chrono::milliseconds(kPatience).count());
    zmq_setsockopt(socket_, ZMQ_LINGER, &zero, sizeof zero);
    zmq_setsockopt(socket_, ZMQ_ROUTER_HANDOVER, &one, sizeof one);
    zmq_setsockopt(socket_, ZMQ_RCVHWM, &one, sizeof one);
    zmq_setsockopt(socket_, ZMQ_RCVTIMEO, &patience_ms, sizeof patience_ms);
    EXPECT_EQ(zmq_bind(socket_, endpoint.c_str()), 0);
  }

  ~RawRouter() {
    zmq_close(socket_);
    zmq_ctx_term(context_);
  }

  // Sends `bytes` over the connection from which a frame with this `route` was received.
  void Send(const std::string& route, const std::string& bytes) {
    EXPECT_EQ(zmq_send(socket_, route.data(), route.size(), ZMQ_SNDMORE), static_cast<int>(route.size()));
    EXPECT_EQ(zmq_send(socket_, bytes.data(), bytes.size(), 0), static_cast<int>(bytes.size()));
  }

  // Returns the next message with its route. Returns an empty Frame if none arrives within kPatience.
  Frame Receive(int flags = 0) {
    if (waiting_.empty()) {
      const std::string route = ReceiveFrom(socket_, flags).value_or("");
      if (route.empty()) return {};
      ++frames_;
      proto::PeerFrame frame;
      EXPECT_TRUE(frame.ParseFromString(ReceiveFrom(socket_).value_or("")));
      last_link_ = frame.link_number();
      for (const proto::Message& message : frame.messages()) waiting_.push_back({route, message});
    }
    Frame next = std::move(waiting_.front());
    waiting_.pop_front();
    return next;
  }

  // Returns the next message that is not a LinkReport. The test fails if none arrives within kPatience.
  proto::Message ReceiveMessage() {
    for (Frame frame = Receive(); !frame.route.empty(); frame = Receive()) {
      if (!frame.message.has_link_report()) return frame.message;
      last_report_ = frame.message.link_report();
    }
    ADD_FAILURE() << "no message came";
    return {};
  }

  // Returns the next LinkReport for which `is_wanted` returns true. Skips other messages. The test fails if none
  // arrives within kPatience.
  proto::LinkReport ReceiveReport(const std::function<bool(const proto::LinkReport&)>& is_wanted) {
    for (Frame frame = Receive(); !frame.route.empty(); frame = Receive()) {
      if (!frame.message.has_link_report()) continue;
      last_report_ = frame.message.link_report();
      if (is_wanted(last_report_)) return last_report_;
    }
    ADD_FAILURE() << "no such report came";
    return {};
  }

  int frames() const { return frames_; }  // Number of frames received so far.
  const proto::LinkReport& last_report() const { return last_report_; }
  std::uint32_t last_link() const { return last_link_; }  // Link number of the last frame.

 private:
  void* context_;
  void* socket_;
  int frames_ = 0;
  std::deque<Frame> waiting_;  // Messages of the last frame that Receive has not returned yet.
  proto::LinkReport last_report_;
  std::uint32_t last_link_ = 0;
};

class TransportFixture : public ::testing::Test {
 protected:
  TransportFixture() { MakeTeam(/*is_insecure=*/false); }

  void MakeTeam(bool is_insecure) {
    proto::TeamConfig team;
    team.set_team("test");
    team.set_insecure(is_insecure);
    for (AgentId id = 1; id <= 3; ++id) {
      proto::AgentConfig* agent = team.add_agents();
      agent->set_id(id);
      agent->set_name("rover" + std::to_string(id));
      agent->set_address("ipc://" + (folder_ / ("agent" + std::to_string(id))).string());
    }
    const std::filesystem::path path = folder_ / (is_insecure ? "insecure.yaml" : "team.yaml");
    const Result<void> written = WriteTeam(path, team);
    ASSERT_TRUE(written) << ToString(written.error());
    team_ = ReadTeamFile(path).value();
  }

  Result<std::unique_ptr<ZeroMqTransport>> Create(AgentId self, ZeroMqTransport::Options options = {}) {
    options.self = self;
    return ZeroMqTransport::Create(team_.config, team_.folder, options, ears_[self].deliver(),
                                   ears_[self].peer_changed());
  }

  ZeroMqTransport& Start(AgentId self, ZeroMqTransport::Options options = {}) {
    auto transport = Create(self, std::move(options));
    EXPECT_TRUE(transport) << ToString(transport.error());
    return *(transports_[self] = std::move(*transport));
  }

  static proto::Message Message(AgentId hop_sender, AgentId to, std::size_t bytes = 10) {
    proto::Message message;
    message.set_hop_sender(hop_sender);
    message.set_destination_id(to);
    message.set_destination_actor("sync");
    message.set_record_id(std::string(bytes, 'x'));
    return message;
  }

  proto::PeerStatus Peer(AgentId self, AgentId peer) {
    for (const proto::PeerStatus& status : transports_[self]->Peers()) {
      if (status.agent_id() == peer) return status;
    }
    ADD_FAILURE() << "no peer " << peer;
    return {};
  }

  RawDealer::Keys KeysOf(AgentId agent, AgentId server) {
    const auto public_path = [&](AgentId id) { return team_.folder / FindAgent(team_.config, id)->key(); };
    return {ReadPublicKey(public_path(server)).value(),
            {ReadPublicKey(public_path(agent)).value(), ReadSecretKey(SecretKeyPath(public_path(agent))).value()}};
  }

  std::string AddressOf(AgentId agent) { return FindAgent(team_.config, agent)->address(); }
  std::string ClientEndpointHere() { return "ipc://" + (folder_ / "run" / "rover1.sock").string(); }

  const TemporaryFolder temporary_;  // Declared before the transports, so that it outlives them.
  const std::filesystem::path folder_ = temporary_.path();
  TeamFile team_;
  std::map<AgentId, Ear> ears_;
  std::map<AgentId, std::unique_ptr<ZeroMqTransport>> transports_;
};

}  // namespace moondb
