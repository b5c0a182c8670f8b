#include "runtime/zeromq_transport.h"

#include <pthread.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <unistd.h>
#include <zmq.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <map>
#include <optional>
#include <thread>
#include <utility>

#include "model/check.h"
#include "runtime/client_table.h"
#include "runtime/curve_keys.h"
#include "runtime/inbound.h"
#include "runtime/listen_address.h"
#include "runtime/outbox.h"
#include "runtime/peer_link.h"
#include "runtime/private_folder.h"
#include "runtime/rate_limited_log.h"
#include "runtime/team_config.h"
#include "runtime/zap_handler.h"
#include "runtime/zmq_socket.h"

namespace moondb {
namespace {

constexpr int kPeerQueueMessages = 16;  // Received from one peer and not yet delivered.
constexpr int kClientQueueMessages = 16;
constexpr int kSocketBufferBytes = 16 * 1024;
constexpr int kBatchMessages = 64;  // Of one socket before the others have their turn.
constexpr std::size_t kClientsMax = 256;
constexpr std::size_t kClientRepliesMax = 1024;

struct TeamKeys {
  CurveKeys own;
  std::map<AgentId, std::string> public_keys;  // Of the whole team.
};

Result<TeamKeys> ReadTeamKeys(const proto::TeamConfig& team, const std::filesystem::path& folder,
                              const ZeroMqTransport::Options& options) {
  TeamKeys keys;
  for (const proto::AgentConfig& agent : team.agents()) {
    const Result<std::string> key = ReadPublicKey(folder / agent.key());
    if (!key) return tl::unexpected(key.error());
    keys.public_keys[agent.id()] = *key;
  }
  const std::filesystem::path public_path = folder / FindAgent(team, options.self)->key();
  const std::filesystem::path secret_path =
      options.secret_key_file.empty() ? SecretKeyPath(public_path) : std::filesystem::path(options.secret_key_file);
  const Result<std::string> secret = ReadSecretKey(secret_path);
  if (!secret) return tl::unexpected(secret.error());
  keys.own = {keys.public_keys[options.self], *secret};
  if (const Result<std::string> fitting = PublicKeyOf(*secret); !fitting || *fitting != keys.own.public_key) {
    return Fail(ErrorCode::kInvalid, secret_path.string() + ": does not fit the public key " + public_path.string());
  }
  return keys;
}

// Closed on destruction; any thread wakes, one sleeps on it.
class WakeUp {
 public:
  WakeUp() : file_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) { Check(file_ >= 0, "the system gives an eventfd"); }
  ~WakeUp() { close(file_); }
  WakeUp(const WakeUp&) = delete;
  WakeUp& operator=(const WakeUp&) = delete;

  void Ring() {
    if (is_ringing_.exchange(true)) return;
    const std::uint64_t one = 1;
    (void)!write(file_, &one, sizeof one);
  }

  // Before looking for work: what is pushed from now on rings again.
  void Quiet() {
    std::uint64_t count = 0;
    (void)!read(file_, &count, sizeof count);
    is_ringing_ = false;
  }

  int file() const { return file_; }

 private:
  const int file_;
  std::atomic<bool> is_ringing_{false};
};

}  // namespace

class ZeroMqTransport::Impl {
 public:
  Impl(const proto::TeamConfig& team, Options options, Deliver deliver, PeerChanged peer_changed)
      : team_(team),
        options_(std::move(options)),
        deliver_(std::move(deliver)),
        peer_changed_(std::move(peer_changed)),
        context_(MakeZmqContext(/*io_threads=*/1)),
        client_outbox_(options_.message_bytes_max, kClientRepliesMax, /*is_open=*/true) {}

  ~Impl() {
    if (!thread_.joinable()) return;
    is_stopping_ = true;
    wake_up_.Ring();
    thread_.join();
  }

  // The thread's creation hands all sockets over to it.
  Result<void> Start(const std::string& team_folder) {
    Check(FindAgent(team_, options_.self) != nullptr, "the agent itself is in the team");
    if (!team_.insecure()) {
      Result<TeamKeys> keys = ReadTeamKeys(team_, team_folder, options_);
      if (!keys) return tl::unexpected(keys.error());
      keys_ = std::move(*keys);
    }
    if (const auto opened = OpenZapHandler(); !opened) return opened;
    if (const auto opened = OpenRouter(); !opened) return opened;
    if (const auto opened = OpenClients(); !opened) return opened;
    if (const auto opened = OpenPeers(); !opened) return opened;
    thread_ = std::thread([this] { Run(); });
    return {};
  }

  SendResult Send(const Address& to, const proto::Message& message) {
    SendResult result = SendResult::kNoPeer;
    if (to.agent == kClients) {
      result = SendToClient(to.actor, message);
    } else if (const auto peer = peers_.find(to.agent); peer != peers_.end()) {
      result = peer->second->Send(message);
    }
    if (result == SendResult::kAccepted) wake_up_.Ring();
    return result;
  }

  std::vector<proto::PeerStatus> Peers() const {
    std::vector<proto::PeerStatus> statuses;
    for (const auto& [id, peer] : peers_) statuses.push_back(peer->Status());
    return statuses;
  }

 private:
  Result<void> OpenZapHandler() {
    if (!keys_) return {};
    std::map<std::string, AgentId> agents;
    for (const auto& [agent, key] : keys_->public_keys) {
      if (agent != options_.self) agents[key] = agent;
    }
    Result<ZapHandler> handler = ZapHandler::Make(context_, std::move(agents));
    if (!handler) return tl::unexpected(handler.error());
    zap_handler_ = std::move(*handler);
    return {};
  }

  Result<void> OpenRouter() {
    Result<ZmqSocket> router = ZmqSocket::Make(context_, ZMQ_ROUTER);
    if (!router) return tl::unexpected(router.error());
    router->Set(ZMQ_ROUTER_HANDOVER, 1);
    router->Set(ZMQ_RCVHWM, kPeerQueueMessages);
    router->Set(ZMQ_SNDHWM, 1);
    router->Set(ZMQ_RCVBUF, kSocketBufferBytes);
    router->SetInt64(ZMQ_MAXMSGSIZE, static_cast<std::int64_t>(options_.message_bytes_max));
    if (keys_) {
      router->Set(ZMQ_CURVE_SERVER, 1);
      router->Set(ZMQ_CURVE_SECRETKEY, keys_->own.secret_key);
      router->Set(ZMQ_ZAP_DOMAIN, "moondb");
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
    Check(options_.client_endpoint.starts_with("ipc://"), "clients come over ipc");
    const std::filesystem::path path = options_.client_endpoint.substr(6);
    if (const auto made = MakePrivateFolder(path.parent_path()); !made) return made;
    if (const auto claimed = ClaimIpcPath(options_.client_endpoint); !claimed) return claimed;
    Result<ZmqSocket> clients = ZmqSocket::Make(context_, ZMQ_ROUTER);
    if (!clients) return tl::unexpected(clients.error());
    // A client that left, or one that does not read its replies, is an error at once and holds up nobody.
    clients->Set(ZMQ_ROUTER_MANDATORY, 1);
    clients->Set(ZMQ_RCVHWM, kClientQueueMessages);
    clients->Set(ZMQ_SNDHWM, kClientQueueMessages);
    clients->SetInt64(ZMQ_MAXMSGSIZE, static_cast<std::int64_t>(options_.message_bytes_max));
    if (const auto bound = clients->Bind(options_.client_endpoint); !bound) return bound;
    clients_ = std::move(*clients);
    return {};
  }

  Result<void> OpenPeers() {
    for (const proto::AgentConfig& agent : team_.agents()) {
      if (agent.id() == options_.self) continue;
      PeerLink::Options options;
      options.self = options_.self;
      options.peer = agent.id();
      options.name = agent.name();
      options.address = agent.address();
      if (keys_) {
        options.own_keys = keys_->own;
        options.peer_key = keys_->public_keys[agent.id()];
      }
      options.message_bytes_max = options_.message_bytes_max;
      options.outbox_bytes_max = options_.outbox_bytes_max;
      Result<std::unique_ptr<PeerLink>> link = PeerLink::Make(context_, std::move(options));
      if (!link) return tl::unexpected(link.error());
      peers_[agent.id()] = std::move(*link);
    }
    return {};
  }

  SendResult SendToClient(const std::string& name, const proto::Message& message) {
    const std::optional<std::string> routing_id = client_table_.RoutingIdOf(name);
    if (!routing_id) return SendResult::kUnreachable;
    if (message.ByteSizeLong() > options_.message_bytes_max) return SendResult::kFull;
    return client_outbox_.Push({*routing_id, message.SerializeAsString()});
  }

  void Run() {
    pthread_setname_np(pthread_self(), "transport");
    std::vector<zmq_pollitem_t> items;
    while (!is_stopping_) {
      CollectPollItems(&items);
      // Without a timeout: an idle agent must use no battery.
      if (zmq_poll(items.data(), static_cast<int>(items.size()), -1) < 0) {
        Check(zmq_errno() == EINTR, "libzmq polls the transport's sockets");
        continue;
      }
      wake_up_.Quiet();
      if (zap_handler_) OnHandshakes();
      for (const auto& [id, peer] : peers_) peer->OnMonitorReadable(peer_changed_);
      ReceiveFromPeers();
      if (clients_) ReceiveFromClients();
      for (const auto& [id, peer] : peers_) peer->Flush();
      FlushClients();
    }
  }

  void CollectPollItems(std::vector<zmq_pollitem_t>* items) const {
    items->clear();
    items->push_back({nullptr, wake_up_.file(), ZMQ_POLLIN, 0});
    items->push_back({router_->get(), 0, ZMQ_POLLIN, 0});
    if (zap_handler_) items->push_back({zap_handler_->socket(), 0, ZMQ_POLLIN, 0});
    if (clients_) items->push_back({clients_->get(), 0, ZMQ_POLLIN, 0});
    for (const auto& [id, peer] : peers_) {
      items->push_back({peer->monitor(), 0, ZMQ_POLLIN, 0});
      if (peer->is_waiting()) items->push_back({peer->socket(), 0, ZMQ_POLLOUT, 0});
    }
  }

  void OnHandshakes() {
    const std::uint64_t refused_before = zap_handler_->refused();
    zap_handler_->OnReadable();
    if (zap_handler_->refused() > refused_before) {
      refused_log_.Warn("transport: refused a connection whose key is not of this team");
    }
  }

  void ReceiveFromPeers() {
    ZmqParts parts;
    for (int i = 0; i < kBatchMessages && router_->Receive(&parts); ++i) OnPeerFrame(parts);
  }

  void OnPeerFrame(const ZmqParts& parts) {
    std::optional<AgentId> authenticated;
    if (keys_) authenticated = AgentOfUserId(parts.user_id);
    // Without keys the connection's own word has to do for whom to blame.
    const AgentId blamed = authenticated.value_or(AgentOfUserId(parts.parts[0]));
    if (parts.count != 2) return Reject(blamed, "sent a frame of several parts");
    const std::string& frame = parts.parts[1];
    Result<MessagePtr> message = ParsePeerFrame(frame, authenticated);
    if (!message) return Reject(blamed, message.error().text);
    const auto peer = peers_.find((*message)->hop_sender());
    if (peer == peers_.end()) return Reject(blamed, "claimed to be an agent that the team does not have");
    peer->second->CountReceived(frame.size());
    deliver_(std::move(*message));
  }

  void Reject(AgentId blamed, const std::string& what) {
    const auto peer = peers_.find(blamed);
    if (peer != peers_.end()) peer->second->CountRejected();
    rejected_log_.Warn("transport: " + (peer == peers_.end() ? "somebody" : peer->second->name()) + " " + what);
  }

  void ReceiveFromClients() {
    ZmqParts parts;
    for (int i = 0; i < kBatchMessages && clients_->Receive(&parts); ++i) OnClientFrame(parts);
  }

  void OnClientFrame(const ZmqParts& parts) {
    if (parts.count != 2) return client_log_.Warn("transport: a client sent a frame of several parts");
    Result<MessagePtr> message = ParseClientFrame(parts.parts[1], client_table_.NameOf(parts.parts[0]), options_.self);
    if (!message) return client_log_.Warn("transport: a client " + message.error().text);
    deliver_(std::move(*message));
  }

  void FlushClients() {
    while (const Outbox::Entry* entry = client_outbox_.Front()) {
      const ZmqSend sent = clients_->Send({&entry->route, &entry->frame});
      if (sent == ZmqSend::kNoRoute) client_table_.Forget(entry->route);
      if (sent == ZmqSend::kWouldBlock) client_log_.Warn("transport: dropped a reply; its client does not read");
      client_outbox_.PopFront();
    }
  }

  const proto::TeamConfig team_;
  const Options options_;
  const Deliver deliver_;
  const PeerChanged peer_changed_;
  std::optional<TeamKeys> keys_;  // None without CURVE.

  ZmqContext context_;  // Before all sockets: it outlives them.
  std::optional<ZapHandler> zap_handler_;
  std::optional<ZmqSocket> router_;
  std::optional<ZmqSocket> clients_;
  std::map<AgentId, std::unique_ptr<PeerLink>> peers_;  // Fixed once the thread runs.
  ClientTable client_table_{kClientsMax};
  Outbox client_outbox_;
  WakeUp wake_up_;

  RateLimitedLog refused_log_;
  RateLimitedLog rejected_log_;
  RateLimitedLog client_log_;

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

SendResult ZeroMqTransport::Send(const Address& to, MessagePtr message) { return impl_->Send(to, *message); }

std::vector<proto::PeerStatus> ZeroMqTransport::Peers() const { return impl_->Peers(); }

}  // namespace moondb
