#include "runtime/transport/zeromq_transport.h"

#include <poll.h>
#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <thread>
#include <utility>

#include "model/check.h"
#include "model/control_request.h"
#include "model/team_member.h"
#include "proto/status.pb.h"
#include "runtime/rate_limited_log.h"
#include "runtime/team/client_list.h"
#include "runtime/team/team_keys.h"
#include "runtime/transport/client_door.h"
#include "runtime/transport/door_guard.h"
#include "runtime/transport/inbound.h"
#include "runtime/transport/link_routes.h"
#include "runtime/transport/listen_address.h"
#include "runtime/transport/peer_link.h"
#include "runtime/transport/wake_up.h"
#include "runtime/transport/zap_handler.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb {
namespace {

constexpr int kPeerQueueMessages = 256;  // Received from one peer and not yet delivered; its credit bounds their bytes.
constexpr int kKeepAlive_s = 60;
constexpr std::size_t kConnectionsPerAgent = 4;  // One that is, one that takes its place; two more at a reconnect.
constexpr std::size_t kStrangersMax = 32;        // Connections to the agents' address from elsewhere.
constexpr std::size_t kKeyedClientsMax = 64;     // Connections to client_address.
constexpr std::size_t kBatchMessages = 256;      // Of one socket before the others have their turn.
// What CURVE adds to a frame. libzmq holds ZMQ_MAXMSGSIZE against the frame with it, and cuts the link.
constexpr std::size_t kCurveBytes = 64;
// Beyond the free bytes of each connection, of all agents together: the largest credit of a link that this agent is
// slow to read.
constexpr std::uint64_t kAgentsSharedBytes = 1024 * 1024;
static_assert(kPeerFrameBytesMax + kCurveBytes < ConnectionRules::kFreeBytes, "each frame can be delivered");
static_assert(LinkCredit::Options().bytes_max <= kAgentsSharedBytes);
// After peers sent something the thread stays awake for so long, in case an answer follows: to put a processor to sleep
// and to wake it takes tens of microseconds, and as much processor time (measured: a round trip takes 0.6 of the time).
constexpr Duration kLingerTime = std::chrono::microseconds(60);

// Places among the files that the thread waits for.
constexpr std::size_t kRouterFile = 1;
constexpr std::size_t kGuardFile = 2;
constexpr std::size_t kDoorsMax = 2;
constexpr std::size_t kOtherFiles = 4 + kDoorsMax;  // Before those of peers.

// For ppoll.
timespec TimeUntil(MonotonicTime time) {
  if (time == MonotonicTime::min()) return {};
  const Duration left =
      std::clamp<Duration>(time - std::chrono::steady_clock::now(), Duration::zero(), std::chrono::hours(1));
  const auto whole = std::chrono::floor<std::chrono::seconds>(left);
  return {.tv_sec = whole.count(), .tv_nsec = (left - whole).count()};
}

}  // namespace

class ZeroMqTransport::Impl {
 public:
  Impl(const proto::TeamConfig& team, Options options, Deliver deliver, PeerChanged peer_changed)
      : team_(team),
        options_(std::move(options)),
        deliver_(std::move(deliver)),
        peer_changed_(std::move(peer_changed)),
        context_(MakeZmqContext(/*io_threads=*/1)) {}

  ~Impl() {
    if (!thread_.joinable()) return;
    is_stopping_ = true;
    wake_up_.RingFor();
    thread_.join();
  }

  // The thread's creation hands all sockets over to it.
  Result<void> Start(const std::string& team_folder) {
    Check(FindAgent(team_, options_.self) != nullptr, "the agent itself is in the team");
    if (!team_.insecure()) {
      Result<TeamKeys> keys = ReadTeamKeys(team_, team_folder, options_.self, options_.secret_key_file);
      if (!keys) return tl::unexpected(keys.error());
      keys_ = std::move(*keys);
    }
    if (const auto opened = OpenZapHandler(); !opened) return opened;
    if (const auto opened = OpenRouter(); !opened) return opened;
    if (const auto opened = OpenClients(); !opened) return opened;
    if (const auto opened = OpenKeyedClients(); !opened) return opened;
    if (const auto opened = OpenPeers(); !opened) return opened;
    if (const auto opened = OpenGuard(); !opened) return opened;
    thread_ = std::thread([this] { Run(); });
    return {};
  }

  SendResult Send(const Address& to, const proto::Message& message) {
    Check(!message.has_link_report(), "only transports send link reports");
    if (to.agent == kClients) {
      SendResult sent = SendResult::kUnreachable;  // By a door that does not know the client.
      for (const auto& door : doors_) {
        if (sent == SendResult::kUnreachable) sent = door->Send(to.actor, message);
      }
      return sent;
    }
    const auto peer = peers_.find(to.agent);
    return peer == peers_.end() ? SendResult::kNoPeer : peer->second->Send(message);
  }

  std::vector<proto::PeerStatus> Peers() const {
    std::vector<proto::PeerStatus> statuses;
    for (const auto& [id, peer] : peers_) statuses.push_back(peer->Status());
    return statuses;
  }

  proto::DoorStatus Door() const {
    proto::DoorStatus status;
    status.set_unknown_agent_keys(static_cast<double>(refused_.agents.load()));
    status.set_unknown_client_keys(static_cast<double>(refused_.clients.load()));
    if (!guard_) return status;
    status.set_cut_for_number(static_cast<double>(guard_->cut_for_number()));
    status.set_cut_for_bytes(static_cast<double>(guard_->cut_for_bytes()));
    return status;
  }

 private:
  Result<void> OpenZapHandler() {
    if (!keys_) return {};
    std::map<std::string, AgentId> agents;
    for (const auto& [agent, key] : keys_->public_keys) {
      if (agent != options_.self && !HasLeft(team_, agent)) agents[key] = agent;
    }
    Result<ZapHandler> handler =
        ZapHandler::Make(context_, std::move(agents), [this](bool is_client) { OnRefusedKey(is_client); });
    if (!handler) return tl::unexpected(handler.error());
    zap_handler_ = std::move(*handler);
    return {};
  }

  Result<void> OpenRouter() {
    Result<ZmqSocket> router = ZmqSocket::Make(context_, ZMQ_ROUTER);
    if (!router) return tl::unexpected(router.error());
    router->Set(ZMQ_RCVHWM, kPeerQueueMessages);
    router->Set(ZMQ_SNDHWM, 1);
    router->Set(ZMQ_HANDSHAKE_IVL, kHandshakeMax_ms);
    router->SetInt64(ZMQ_MAXMSGSIZE, static_cast<std::int64_t>(options_.frame_bytes_max + kCurveBytes));
    if (keys_) {
      router->Set(ZMQ_CURVE_SERVER, 1);
      router->Set(ZMQ_CURVE_SECRETKEY, keys_->own.secret_key);
      router->Set(ZMQ_ZAP_DOMAIN, ZapHandler::kAgentDomain);
      // A connection whose machine went away sends nothing and is not replaced.
      router->Set(ZMQ_TCP_KEEPALIVE, 1);
      router->Set(ZMQ_TCP_KEEPALIVE_IDLE, kKeepAlive_s);
    } else {
      router->Set(ZMQ_ROUTER_HANDOVER, 1);
    }
    const std::string& address = FindAgent(team_, options_.self)->address();
    if (address.find('[') != std::string::npos) router->Set(ZMQ_IPV6, 1);
    if (const auto claimed = ClaimIpcPath(address); !claimed) return claimed;
    const Result<std::string> endpoint = NumericEndpoint(address);
    if (!endpoint) return tl::unexpected(endpoint.error());
    if (const auto bound = router->Bind(*endpoint); !bound) return bound;
    router_ = std::move(*router);
    return {};
  }

  Result<void> OpenClients() {
    if (options_.client_endpoint.empty()) return {};
    ClientDoor::Options options;
    options.self = options_.self;
    options.endpoint = options_.client_endpoint;
    return OpenDoor(std::move(options));
  }

  Result<void> OpenKeyedClients() {
    const std::string& address = FindAgent(team_, options_.self)->client_address();
    if (address.empty()) return {};
    Check(keys_.has_value(), "a team without keys has no client_address");
    client_keys_ = ClientKeys::Open(options_.clients_file, std::chrono::steady_clock::now());
    zap_handler_->LetClientsIn([this](const std::string& key) {
      return client_keys_->Find(key, std::chrono::steady_clock::now()).has_value();
    });
    ClientDoor::Options options;
    options.self = options_.self;
    options.endpoint = address;
    options.on_message = [this](int file, std::string_view key) {
      OnWholeMessage(file, key, TcpConnections::PeerPortOf(file));
    };
    options.secret_key = keys_->own.secret_key;
    options.identity_of = [this](const std::string& key) {
      const auto client = client_keys_->Find(key, std::chrono::steady_clock::now());
      return client ? ClientIdentity{client->rights(), client->name()} : ClientIdentity();
    };
    return OpenDoor(std::move(options));
  }

  Result<void> OpenDoor(ClientDoor::Options options) {
    options.message_bytes_max = options_.client_message_bytes_max;
    Result<std::unique_ptr<ClientDoor>> door = ClientDoor::Open(context_, wake_up_, std::move(options));
    if (!door) return tl::unexpected(door.error());
    doors_.push_back(std::move(*door));
    return {};
  }

  Result<void> OpenPeers() {
    for (const proto::AgentConfig& agent : team_.agents()) {
      if (agent.id() == options_.self || agent.left()) continue;
      PeerLink::Options options;
      options.name = agent.name();
      options.connection.self = options_.self;
      options.connection.peer = agent.id();
      options.connection.address = agent.address();
      if (keys_) {
        options.connection.own_keys = keys_->own;
        options.connection.peer_key = keys_->public_keys[agent.id()];
      }
      options.connection.frame_bytes_max = options_.frame_bytes_max;
      options.credit = options_.credit;
      options.outbox = options_.outbox;
      options.health = options_.health;
      Result<std::unique_ptr<PeerLink>> link = PeerLink::Make(context_, wake_up_, std::move(options));
      if (!link) return tl::unexpected(link.error());
      peers_[agent.id()] = std::move(*link);
    }
    return {};
  }

  // Agents whose address is a name have their places among the others'.
  Result<void> OpenGuard() {
    std::map<std::uint16_t, ConnectionRules::Door> doors;
    const proto::AgentConfig& self = *FindAgent(team_, options_.self);
    if (const std::optional<std::uint16_t> port = TcpPortOf(self.address())) {
      ConnectionRules::Door& door = doors[*port];
      door.others_max = kStrangersMax;
      door.key_max = kConnectionsPerAgent;
      door.shared_bytes = kAgentsSharedBytes;
      for (const proto::AgentConfig& agent : team_.agents()) {
        if (agent.left()) continue;
        const std::string address = NumericAddressOf(agent.address());
        (address.empty() ? door.others_max : door.places[address]) += kConnectionsPerAgent;
      }
    }
    if (const std::optional<std::uint16_t> port = TcpPortOf(self.client_address())) {
      doors[*port] = {.places = {},
                      .others_max = kKeyedClientsMax,
                      .key_max = ClientDoor::kConnectionsOfKeyMax,
                      .shared_bytes = kKeyedRequestBytesMax};
    }
    if (doors.empty()) return {};
    Result<std::unique_ptr<DoorGuard>> guard = DoorGuard::Make(std::move(doors));
    if (!guard) return tl::unexpected(guard.error());
    guard_ = std::move(*guard);
    return {};
  }

  void OnWholeMessage(int file, std::string_view key, std::uint16_t peer_port = 0) {
    if (guard_) guard_->OnMessage(file, key, peer_port);
  }

  void Run() {
    pthread_setname_np(pthread_self(), "transport");
    while (!is_stopping_) {
      Sleep();
      if (zap_handler_) zap_handler_->OnReadable();
      has_more_ = ReceiveFromPeers();
      // Listening may take in libzmq's news of requests, so that the door's work comes last.
      for (const auto& door : doors_) door->KeepPlace(std::chrono::steady_clock::now());
      for (const auto& door : doors_) has_more_ = door->Work(deliver_) || has_more_;
      const MonotonicTime now = std::chrono::steady_clock::now();
      if (guard_) guard_->Work(now);
      for (const auto& [id, peer] : peers_) peer->Work(now, peer_changed_);
    }
  }

  // Until a socket, a sender or a deadline wants something. libzmq's own poll would ask each socket for its news, which
  // costs several system calls each; their files announce news by themselves, since all sockets are read from until
  // nothing waits.
  void Sleep() {
    Linger();
    wake_up_.IsLooking();
    MonotonicTime deadline = MonotonicTime::max();
    for (const auto& [id, peer] : peers_) deadline = std::min(deadline, peer->deadline());
    for (const auto& door : doors_) deadline = std::min(deadline, door->deadline());
    const bool has_replies =
        std::any_of(doors_.begin(), doors_.end(), [](const auto& door) { return door->has_replies(); });
    if (guard_) deadline = std::min(deadline, guard_->deadline());
    if (has_more_ || is_stopping_ || has_replies) deadline = MonotonicTime::min();
    wake_up_.SleepsUntil(deadline);
    CollectFiles();
    const timespec timeout = TimeUntil(deadline);
    if (ppoll(files_.data(), files_.size(), deadline == MonotonicTime::max() ? nullptr : &timeout, nullptr) < 0) {
      Check(errno == EINTR, "the system waits for the transport's files");
      for (pollfd& file : files_) file.revents = 0;
    }
    wake_up_.IsAwake(/*by_file=*/files_[0].revents != 0);
    is_busy_ = files_[kRouterFile].revents != 0;
    if (files_[kGuardFile].revents != 0) guard_->OnReadable(std::chrono::steady_clock::now());
    std::size_t next = kOtherFiles;
    for (const auto& [id, peer] : peers_) {
      if (files_[next++].revents != 0) peer->OnSocketReadable();
      if (files_[next++].revents != 0) peer->OnMonitorReadable();
    }
  }

  // Others that want the processor have it meanwhile.
  void Linger() {
    if (!std::exchange(is_busy_, false) || has_more_) return;
    CollectFiles();
    constexpr timespec kAtOnce = {};
    const MonotonicTime end = std::chrono::steady_clock::now() + kLingerTime;
    wake_up_.SleepsUntil(end);
    while (ppoll(files_.data(), files_.size(), &kAtOnce, nullptr) == 0 && std::chrono::steady_clock::now() < end) {
      std::this_thread::yield();
    }
  }

  // A negative file is passed over.
  void CollectFiles() {
    files_.clear();
    const auto add = [this](int file) { files_.push_back({file, POLLIN, 0}); };
    add(wake_up_.file());
    add(router_->file());
    add(guard_ ? guard_->file() : -1);
    add(zap_handler_ ? zap_handler_->file() : -1);
    for (std::size_t i = 0; i < kDoorsMax; ++i) add(i < doors_.size() ? doors_[i]->file() : -1);
    for (const auto& [id, peer] : peers_) {
      add(peer->socket_file());
      add(peer->monitor_file());
    }
  }

  void OnRefusedKey(bool is_client) {
    ++(is_client ? refused_.clients : refused_.agents);
    if (is_client) {
      refused_.client_log.Warn("transport: refused a client whose key is not listed");
    } else {
      refused_.agent_log.Warn("transport: refused a connection whose key is not of this team, or has left it");
    }
  }

  // libzmq takes frames of all peers in turn. True if more wait.
  bool ReceiveFromPeers() {
    ZmqRoutedFrame received;
    for (std::size_t messages = 0; messages < kBatchMessages;) {
      if (!router_->Receive(&received)) return false;
      messages += OnPeerFrame(received);
    }
    return true;
  }

  // How many messages it held; 1 for one that was rejected.
  std::size_t OnPeerFrame(const ZmqRoutedFrame& received) {
    OnWholeMessage(received.file, received.frame.user_id());
    std::optional<AgentId> authenticated;
    if (keys_) authenticated = AgentOfUserId(received.frame.user_id());
    Result<std::vector<OwnedMessage>> messages = received.parts == 2
                                                     ? ParsePeerFrame(received.frame.text(), authenticated)
                                                     : Fail(ErrorCode::kCorrupt, "sent a frame of several parts");
    if (messages && !peers_.contains(messages->front()->hop_sender())) {
      messages = Fail(ErrorCode::kRefused, "claimed to be an agent that the team does not have");
    }
    if (!messages) {
      OnRejected(received, authenticated, messages.error().text);
      return 1;
    }
    const AgentId sender = messages->front()->hop_sender();
    PeerLink& peer = *peers_.at(sender);
    const bool is_on_link = IsOnLink(sender, received);
    if (messages->front()->has_link_report()) {
      peer.OnReport(messages->front()->link_report(), is_on_link);
      return 1;
    }
    peer.OnMessages(messages->size(), received.frame.size(), is_on_link);
    for (OwnedMessage& message : *messages) deliver_(std::move(message));
    return messages->size();
  }

  // Without keys libzmq gives a connection that was replaced another routing id than the agent's.
  bool IsOnLink(AgentId sender, const ZmqRoutedFrame& received) {
    if (keys_) return link_routes_.IsNewest(sender, received.route.text());
    return AgentOfUserId(received.route.text()) == sender;
  }

  void OnRejected(const ZmqRoutedFrame& received, std::optional<AgentId> authenticated, const std::string& what) {
    // Without keys the connection's own word has to do for whom to blame.
    const AgentId blamed = authenticated.value_or(AgentOfUserId(received.route.text()));
    const auto peer = peers_.find(blamed);
    if (peer != peers_.end()) peer->second->OnRejected(received.frame.size(), IsOnLink(blamed, received));
    refused_.frame_log.Warn("transport: " + (peer == peers_.end() ? "somebody" : peer->second->name()) + " " + what);
  }

  const proto::TeamConfig team_;
  const Options options_;
  const Deliver deliver_;
  const PeerChanged peer_changed_;
  std::optional<TeamKeys> keys_;  // None without CURVE.

  ZmqContext context_;  // Before all sockets: it outlives them.
  WakeUp wake_up_;
  std::optional<ZapHandler> zap_handler_;
  std::optional<ZmqSocket> router_;
  std::optional<ClientKeys> client_keys_;
  std::vector<std::unique_ptr<ClientDoor>> doors_;
  std::map<AgentId, std::unique_ptr<PeerLink>> peers_;  // Fixed once the thread runs.
  LinkRoutes link_routes_;

  std::unique_ptr<DoorGuard> guard_;  // None where nobody listens on TCP.

  std::vector<pollfd> files_;
  bool is_busy_ = false;   // Peers sent something just now.
  bool has_more_ = false;  // A socket was not read from until nothing waits.
  struct Refused {
    std::atomic<std::uint64_t> agents = 0;  // Handshakes.
    std::atomic<std::uint64_t> clients = 0;
    RateLimitedLog agent_log;
    RateLimitedLog client_log;
    RateLimitedLog frame_log;
  };
  Refused refused_;

  std::atomic<bool> is_stopping_{false};
  std::thread thread_;
};

Result<std::unique_ptr<ZeroMqTransport>> ZeroMqTransport::Create(const proto::TeamConfig& team,
                                                                 const std::string& team_folder, Options options,
                                                                 Deliver deliver, PeerChanged peer_changed) {
  auto impl = std::make_unique<Impl>(team, std::move(options), std::move(deliver), std::move(peer_changed));
  if (const Result<void> started = impl->Start(team_folder); !started) return tl::unexpected(started.error());
  return std::unique_ptr<ZeroMqTransport>(new ZeroMqTransport(std::move(impl)));
}

ZeroMqTransport::ZeroMqTransport(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

ZeroMqTransport::~ZeroMqTransport() = default;

SendResult ZeroMqTransport::Send(const Address& to, const proto::Message& message) { return impl_->Send(to, message); }

std::vector<proto::PeerStatus> ZeroMqTransport::Peers() const { return impl_->Peers(); }

proto::DoorStatus ZeroMqTransport::Door() const { return impl_->Door(); }

}  // namespace moondb
