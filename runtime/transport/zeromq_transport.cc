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
#include <span>
#include <thread>
#include <utility>

#include "model/check.h"
#include "model/control_request.h"
#include "model/team_member.h"
#include "proto/status.pb.h"
#include "runtime/rate_limited_log.h"
#include "runtime/team/client_list.h"
#include "runtime/team/team_keys.h"
#include "runtime/transport/client_listener.h"
#include "runtime/transport/connection_limiter.h"
#include "runtime/transport/handshake_limit.h"
#include "runtime/transport/inbound.h"
#include "runtime/transport/link_order.h"
#include "runtime/transport/listen_address.h"
#include "runtime/transport/listener_limits.h"
#include "runtime/transport/peer_link.h"
#include "runtime/transport/wake_up.h"
#include "runtime/transport/zap_handler.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb {
namespace {

constexpr int kPeerQueueMessages = 16;  // Limit of received frames of one connection that wait for delivery.
constexpr int kKeepAlive_s = 60;
// Limits of messages and time per call of ReceiveFromPeers. Some frames take 14 ms to parse.
constexpr std::size_t kBatchMessages = 256;
constexpr Duration kTurnTime = std::chrono::milliseconds(5);
// Upper limit of the bytes that CURVE adds to a frame. libzmq applies ZMQ_MAXMSGSIZE to the encrypted frame, and closes
// the connection if it is exceeded.
constexpr std::size_t kCurveBytes = 64;
static_assert(kPeerFrameBytesMax + kCurveBytes < ConnectionRules::kFreeBytes, "each frame can be delivered");
static_assert(LinkCredit::Options().bytes_max <= kAgentsSharedBytes);
// After receiving from peers, the thread stays awake this long in case an answer follows. Putting a processor to sleep
// and waking it takes tens of microseconds. Measured: staying awake shortens a round trip to 0.6 of its time.
constexpr Duration kLingerTime = std::chrono::microseconds(60);

// Indices in files_, the descriptors that the thread waits for.
constexpr std::size_t kPeerListenerFile = 1;
constexpr std::size_t kGuardFile = 2;
constexpr std::size_t kClientListenersMax = 2;
constexpr std::size_t kAcceptedFiles = 4 + kClientListenersMax;
constexpr std::size_t kListenersMax = 3;  // Limit of listening sockets whose accepted connections are watched.
constexpr std::size_t kOtherFiles = kAcceptedFiles + kListenersMax;  // Number of descriptors before those of peers.

// Returns the time left until `time`, at most one hour, as a timeout for ppoll.
timespec TimeUntil(MonotonicTime time) {
  if (time == MonotonicTime::min()) return {};
  const Duration left =
      std::clamp<Duration>(time - std::chrono::steady_clock::now(), Duration::zero(), std::chrono::hours(1));
  const auto whole = std::chrono::floor<std::chrono::seconds>(left);
  return {.tv_sec = whole.count(), .tv_nsec = (left - whole).count()};
}

// Converts an address to the form of TcpConnection::peer. libzmq appends the interface to a link-local address, and
// writes an IPv4 address over IPv6 in its mapped form.
std::string PlainAddress(const std::string& address) {
  constexpr std::string_view kMapped = "::ffff:";
  const std::string plain = address.substr(0, address.find('%'));
  return plain.starts_with(kMapped) ? plain.substr(kMapped.size()) : plain;
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

  // Opens all sockets and starts the thread, which then owns the sockets.
  Result<void> Start(const std::string& team_folder) {
    Check(FindAgent(team_, options_.self) != nullptr, "the agent itself is in the team");
    if (!team_.insecure()) {
      Result<TeamKeys> keys = ReadTeamKeys(team_, team_folder, options_.self, options_.secret_key_file);
      if (!keys) return tl::unexpected(keys.error());
      keys_ = std::move(*keys);
    }
    if (const auto opened = OpenZapHandler(); !opened) return opened;
    if (const auto opened = OpenPeerListener(); !opened) return opened;
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
      SendResult sent = SendResult::kUnreachable;  // The result if no listener knows the client.
      for (const auto& listener : listeners_) {
        if (sent == SendResult::kUnreachable) sent = listener->Send(to.actor, message);
      }
      return sent;
    }
    const auto peer = peers_.find(to.agent);
    return peer == peers_.end() ? SendResult::kNoPeer : peer->second->Send(message);
  }

  std::uint64_t UnreadReplyBytes(const std::string& connection) const {
    std::uint64_t bytes = 0;
    for (const auto& listener : listeners_) bytes += listener->UnreadBytes(connection);
    return bytes;
  }

  std::vector<proto::PeerStatus> Peers() const {
    std::vector<proto::PeerStatus> statuses;
    for (const auto& [id, peer] : peers_) statuses.push_back(peer->Status());
    return statuses;
  }

  proto::ListenerStatus Listener() const {
    proto::ListenerStatus status;
    status.set_unknown_agent_keys(static_cast<double>(refused_.agents.load()));
    status.set_unknown_client_keys(static_cast<double>(refused_.clients.load()));
    status.set_deferred_client_handshakes(static_cast<double>(refused_.deferred_clients.load()));
    status.set_cut_for_number(static_cast<double>(guard_->cut_for_number()));
    status.set_cut_for_bytes(static_cast<double>(guard_->cut_for_bytes()));
    status.set_cut_for_claimed_id(static_cast<double>(guard_->cut_for_claimed_id()));
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

  // Opens the socket that receives frames of peers. With keys, the socket is a DEALER, which assigns no routing ids
  // that a peer could claim. Each frame contains the number of its connection (LinkOrder). Without keys, the socket is
  // a ROUTER, and the routing id that a connection claims names its agent.
  Result<void> OpenPeerListener() {
    Result<ZmqSocket> listener = ZmqSocket::Make(context_, keys_ ? ZMQ_DEALER : ZMQ_ROUTER);
    if (!listener) return tl::unexpected(listener.error());
    listener->Set(ZMQ_RCVHWM, kPeerQueueMessages);
    listener->Set(ZMQ_SNDHWM, 1);
    listener->Set(ZMQ_HANDSHAKE_IVL, kHandshakeMax_ms);
    listener->SetInt64(ZMQ_MAXMSGSIZE, static_cast<std::int64_t>(options_.frame_bytes_max + kCurveBytes));
    if (keys_) {
      listener->Set(ZMQ_CURVE_SERVER, 1);
      listener->Set(ZMQ_CURVE_SECRETKEY, keys_->own.secret_key);
      listener->Set(ZMQ_ZAP_DOMAIN, ZapHandler::kAgentDomain);
      // Keep-alive closes connections whose machine has disappeared. Nothing else would close them.
      listener->Set(ZMQ_TCP_KEEPALIVE, 1);
      listener->Set(ZMQ_TCP_KEEPALIVE_IDLE, kKeepAlive_s);
    } else {
      listener->Set(ZMQ_ROUTER_HANDOVER, 1);
    }
    if (const auto watched = WatchAccepted(*listener); !watched) return watched;
    const std::string& address = ListenAddressOf(*FindAgent(team_, options_.self));
    if (address.find('[') != std::string::npos) listener->Set(ZMQ_IPV6, 1);
    if (const auto claimed = ClaimIpcPath(address); !claimed) return claimed;
    const Result<std::string> endpoint = NumericEndpoint(address);
    if (!endpoint) return tl::unexpected(endpoint.error());
    if (const auto bound = listener->Bind(*endpoint); !bound) return bound;
    peer_listener_ = std::move(*listener);
    return {};
  }

  // Watches the connections that `listener` accepts. Must be called before `listener` listens.
  Result<void> WatchAccepted(ZmqSocket& listener) {
    const std::string endpoint = "inproc://accepted-" + std::to_string(accepted_.size());
    Result<ZmqSocket> monitor = listener.MakeMonitor(context_, endpoint, ZMQ_EVENT_ACCEPTED);
    if (!monitor) return tl::unexpected(monitor.error());
    accepted_.push_back(std::move(*monitor));
    return {};
  }

  Result<void> OpenClients() {
    if (options_.client_endpoint.empty()) return {};
    ClientListener::Options options;
    options.self = options_.self;
    options.endpoint = options_.client_endpoint;
    options.before_listening = [this](ZmqSocket& listener) { return WatchAccepted(listener); };
    options.on_local_request = [this](int file, const std::string& route) {
      guard_->local().OnRequest(file, route, std::chrono::steady_clock::now());
    };
    options.on_local_reply = [this](const std::string& route) { guard_->local().OnReply(route); };
    return OpenListener(std::move(options));
  }

  Result<void> OpenKeyedClients() {
    const std::string& address = FindAgent(team_, options_.self)->client_address();
    if (address.empty()) return {};
    Check(keys_.has_value(), "a team without keys has no client_address");
    client_keys_ = ClientKeys::Open(options_.clients_file, std::chrono::steady_clock::now());
    zap_handler_->LetClientsIn(
        [this](const std::string& key, const std::string& from) { return AdmitClient(key, from); });
    ClientListener::Options options;
    options.self = options_.self;
    options.endpoint = address;
    options.on_message = [this](int file, std::string_view key, bool has_claimed_id) {
      guard_->OnMessage(file, key, TcpConnections::PeerPortOf(file), has_claimed_id);
    };
    options.admitted_handshakes = [this] { return admitted_clients_; };
    options.before_listening = [this](ZmqSocket& listener) { return WatchAccepted(listener); };
    options.secret_key = keys_->own.secret_key;
    options.identity_of = [this](const std::string& key) {
      const auto client = client_keys_->Find(key, std::chrono::steady_clock::now());
      return client ? ClientIdentity{client->rights(), client->name()} : ClientIdentity();
    };
    return OpenListener(std::move(options));
  }

  Result<void> OpenListener(ClientListener::Options options) {
    options.message_bytes_max = options_.client_message_bytes_max;
    Result<std::unique_ptr<ClientListener>> listener = ClientListener::Open(context_, wake_up_, std::move(options));
    if (!listener) return tl::unexpected(listener.error());
    listeners_.push_back(std::move(*listener));
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

  Result<void> OpenGuard() {
    Result<std::unique_ptr<ConnectionLimiter>> guard = ConnectionLimiter::Make(
        ListenerLimits(team_, *FindAgent(team_, options_.self)), SocketFileOf(options_.client_endpoint));
    if (!guard) return tl::unexpected(guard.error());
    guard_ = std::move(*guard);
    return {};
  }

  void ReadAccepted(MonotonicTime now) {
    for (ZmqSocket& monitor : accepted_) {
      while (const std::optional<ZmqEvent> event = monitor.ReceiveEvent()) guard_->OnAccepted(event->value, now);
    }
    guard_->CutLocal(now);
  }

  void OnMonitorReadable(AgentId id, PeerLink& peer) {
    peer.OnMonitorReadable();
    if (const std::optional<int> file = peer.TakeConnectedFile()) {
      guard_->OnLinkConnected(id, *file, std::chrono::steady_clock::now());
    }
  }

  // Decides whether to admit a client with this key from `address`.
  ZapHandler::Admission AdmitClient(const std::string& key, const std::string& address) {
    const MonotonicTime now = std::chrono::steady_clock::now();
    const std::optional<proto::ListedClient> client = client_keys_->Find(key, now);
    if (!client) return ZapHandler::Admission::kUnknown;
    const std::optional<std::uint16_t> port = TcpPortOf(FindAgent(team_, options_.self)->client_address());
    Check(port.has_value(), "clients with keys come over TCP");
    ReadAccepted(now);  // The guard must know all accepted connections before it decides.
    const bool has_handshakes = handshake_limit_.HasRoom(key, now);
    if (!has_handshakes || !guard_->Admit(*port, key, PlainAddress(address), now)) {
      ++refused_.deferred_clients;
      refused_.deferred_log.Warn(
          "transport: refused client " + client->name() + " for now: its key has " +
          (has_handshakes ? std::to_string(ClientListener::kConnectionsOfKeyMax) + " connections"
                          : "made " + std::to_string(HandshakeLimit::kPerMinute) + " connections within a minute"));
      return ZapHandler::Admission::kNotNow;
    }
    handshake_limit_.Count(key, now);
    ++admitted_clients_;
    return ZapHandler::Admission::kAdmitted;
  }

  void Run() {
    pthread_setname_np(pthread_self(), "transport");
    while (!is_stopping_) {
      Sleep();
      if (zap_handler_) zap_handler_->OnReadable();
      has_more_ = ReceiveFromPeers();
      // Call Work after KeepPlace, which may consume libzmq's notification of new requests.
      for (const auto& listener : listeners_) listener->KeepPlace(std::chrono::steady_clock::now());
      for (const auto& listener : listeners_) has_more_ = listener->Work(deliver_) || has_more_;
      const MonotonicTime now = std::chrono::steady_clock::now();
      guard_->Work(now);
      for (const AgentId flooding : guard_->TakeFloodedLinks()) peers_.at(flooding)->OnFlooded(now);
      for (const auto& [id, peer] : peers_) peer->Work(now, peer_changed_);
    }
  }

  // Sleeps until a socket, a sender or a deadline needs the thread. libzmq's own poll would query each socket, with
  // several system calls each. Polling the descriptors is enough, because each socket is read until it is empty.
  void Sleep() {
    Linger();
    wake_up_.IsLooking();
    MonotonicTime deadline = MonotonicTime::max();
    for (const auto& [id, peer] : peers_) deadline = std::min(deadline, peer->deadline());
    for (const auto& listener : listeners_) deadline = std::min(deadline, listener->deadline());
    const bool has_replies =
        std::any_of(listeners_.begin(), listeners_.end(), [](const auto& listener) { return listener->has_replies(); });
    deadline = std::min(deadline, guard_->deadline());
    if (has_more_ || is_stopping_ || has_replies) deadline = MonotonicTime::min();
    wake_up_.SleepsUntil(deadline);
    CollectFiles();
    const timespec timeout = TimeUntil(deadline);
    if (ppoll(files_.data(), files_.size(), deadline == MonotonicTime::max() ? nullptr : &timeout, nullptr) < 0) {
      Check(errno == EINTR, "the system waits for the transport's files");
      for (pollfd& file : files_) file.revents = 0;
    }
    wake_up_.IsAwake(/*by_file=*/files_[0].revents != 0);
    is_busy_ = files_[kPeerListenerFile].revents != 0;
    if (files_[kGuardFile].revents != 0) guard_->OnReadable(std::chrono::steady_clock::now());
    const auto accepted = std::span(files_).subspan(kAcceptedFiles, kListenersMax);
    if (std::ranges::any_of(accepted, [](const pollfd& file) { return file.revents != 0; })) {
      ReadAccepted(std::chrono::steady_clock::now());
    }
    std::size_t next = kOtherFiles;
    for (const auto& [id, peer] : peers_) {
      if (files_[next++].revents != 0) peer->OnSocketReadable();
      if (files_[next++].revents != 0) OnMonitorReadable(id, *peer);
    }
  }

  // Polls for a short time instead of sleeping, and yields the processor to other threads meanwhile.
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

  // Builds the list for ppoll, which ignores negative descriptors.
  void CollectFiles() {
    files_.clear();
    const auto add = [this](int file) { files_.push_back({file, POLLIN, 0}); };
    add(wake_up_.file());
    add(peer_listener_->file());
    add(guard_->file());
    add(zap_handler_ ? zap_handler_->file() : -1);
    for (std::size_t i = 0; i < kClientListenersMax; ++i) add(i < listeners_.size() ? listeners_[i]->file() : -1);
    for (std::size_t i = 0; i < kListenersMax; ++i) add(i < accepted_.size() ? accepted_[i].file() : -1);
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
      refused_.agent_log.Warn("transport: refused a connection whose key belongs to no present agent of this team");
    }
  }

  // Delivers frames of peers, up to kBatchMessages messages and for kTurnTime. libzmq alternates between the peers.
  // Returns true if more frames may wait.
  bool ReceiveFromPeers() {
    ZmqReceived received;
    const MonotonicTime end = std::chrono::steady_clock::now() + kTurnTime;
    std::size_t messages = 0;
    while (messages < kBatchMessages && std::chrono::steady_clock::now() < end) {
      if (!peer_listener_->Receive(&received)) return false;
      messages += OnPeerFrame(received);
    }
    return true;
  }

  // Delivers the messages of a frame. Returns their number, or 1 for a report or a rejected frame.
  std::size_t OnPeerFrame(const ZmqReceived& received) {
    guard_->OnMessage(received.file, received.frame.user_id());
    std::optional<AgentId> authenticated;
    if (keys_) authenticated = AgentOfUserId(received.frame.user_id());
    std::string_view frame = received.frame.text();
    const std::optional<std::uint32_t> link = TakeLinkNumber(&frame);
    Result<std::vector<OwnedMessage>> messages =
        link && received.parts == 1
            ? ParsePeerFrame(frame, authenticated)
            : Fail(ErrorCode::kCorrupt, "sent a frame of several parts, or without link number");
    if (messages && !peers_.contains(messages->front()->hop_sender())) {
      messages = Fail(ErrorCode::kRefused, "claimed to be an agent that the team does not have");
    }
    // The sender of an invalid frame is the agent of the key. Without keys, it is the agent that the connection's
    // routing id claims.
    const AgentId sender =
        messages ? messages->front()->hop_sender() : authenticated.value_or(AgentOfUserId(received.route.text()));
    const auto peer = peers_.find(sender);
    const bool is_on_link = peer != peers_.end() && link && IsOnLink(sender, *link, received);
    if (!messages) {
      if (peer != peers_.end()) peer->second->OnRejected(frame.size(), is_on_link);
      refused_.frame_log.Warn("transport: " + (peer == peers_.end() ? "somebody" : peer->second->name()) + " " +
                              messages.error().text);
      return 1;
    }
    if (messages->front()->has_link_report()) {
      peer->second->OnReport(messages->front()->link_report(), *link, is_on_link);
      return 1;
    }
    peer->second->OnMessages(messages->size(), frame.size(), is_on_link);
    for (OwnedMessage& message : *messages) deliver_(std::move(message));
    return messages->size();
  }

  // Returns true if the frame arrived over the sender's newest connection. Without keys, libzmq changes the routing id
  // of a replaced connection to one that is not the agent's.
  bool IsOnLink(AgentId sender, std::uint32_t link, const ZmqReceived& received) {
    if (!keys_ && AgentOfUserId(received.route.text()) != sender) return false;
    const int returns_before = link_order_.returns(sender);
    const bool is_newest = link_order_.IsNewest(sender, link);
    if (link_order_.returns(sender) > returns_before) peers_.at(sender)->OnReturn();
    return is_newest;
  }

  const proto::TeamConfig team_;
  const Options options_;
  const Deliver deliver_;
  const PeerChanged peer_changed_;
  std::optional<TeamKeys> keys_;  // Empty without CURVE.

  ZmqContext context_;  // Declared before all sockets, because it must outlive them.
  WakeUp wake_up_;
  std::optional<ZapHandler> zap_handler_;
  // Monitors of the listening sockets. Declared before those sockets, because they must outlive them.
  std::vector<ZmqSocket> accepted_;
  std::optional<ZmqSocket> peer_listener_;
  std::optional<ClientKeys> client_keys_;
  HandshakeLimit handshake_limit_;      // Handshakes of clients, by key.
  std::uint32_t admitted_clients_ = 0;  // Number of admitted handshakes of clients.
  std::vector<std::unique_ptr<ClientListener>> listeners_;
  std::map<AgentId, std::unique_ptr<PeerLink>> peers_;  // Not changed after the thread starts.
  LinkOrder link_order_;

  std::unique_ptr<ConnectionLimiter> guard_;

  std::vector<pollfd> files_;
  bool is_busy_ = false;   // True if data from peers ended the last sleep.
  bool has_more_ = false;  // True if a socket may have more messages.
  struct Refused {
    std::atomic<std::uint64_t> agents = 0;  // Number of refused handshakes of agents.
    std::atomic<std::uint64_t> clients = 0;
    RateLimitedLog agent_log;
    RateLimitedLog client_log;
    std::atomic<std::uint64_t> deferred_clients = 0;
    RateLimitedLog deferred_log;
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

std::uint64_t ZeroMqTransport::UnreadReplyBytes(const std::string& connection) const {
  return impl_->UnreadReplyBytes(connection);
}

std::vector<proto::PeerStatus> ZeroMqTransport::Peers() const { return impl_->Peers(); }

proto::ListenerStatus ZeroMqTransport::Listener() const { return impl_->Listener(); }

}  // namespace moondb
