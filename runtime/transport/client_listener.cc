#include "runtime/transport/client_listener.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "model/check.h"
#include "model/control_message.h"
#include "model/control_request.h"
#include "model/private_folder.h"
#include "runtime/transport/listen_address.h"
#include "runtime/transport/outbound.h"
#include "runtime/transport/zap_handler.h"

namespace moondb {
namespace {

constexpr int kQueueMessages = 16;  // Over ipc: limit of messages in libzmq per client and direction.
// Limits of the messages that wait in libzmq per TCP connection. Each message may have the maximum size. If the client
// reads too slowly, further replies are dropped.
constexpr int kKeyedRequestsWaiting = 2;
constexpr int kKeyedRepliesWaiting = 1;
// A request of a client without rights is parsed up to this size and answered with an error. A larger request is
// dropped.
constexpr std::size_t kRefusedBytesMax = 64 * 1024;
constexpr int kClientBatchMessages = 64;
constexpr std::size_t kRepliesMax = 1024;
constexpr std::size_t kHeldOfKeyMax = 256;  // Limit of held replies of one key.
constexpr std::size_t kClientsMax = 256;    // Limit of clients whose routing ids are kept for replies.
constexpr int kClientKeepAlive_s = 60;
constexpr std::chrono::seconds kPlacePeriod(1);
constexpr std::chrono::milliseconds kHeldPeriod(20);  // Interval between retries of a held reply.
constexpr std::chrono::minutes kHeldMax(2);
constexpr char kIpc[] = "ipc://";
constexpr char kDropsReply[] = "transport: dropped a reply: the client does not read its replies";
constexpr char kKeyedPrefix[] = "k";  // Prefix of the names of clients over tcp://.

// Connections that wait for libzmq to accept them. A client that finds no place tries again after 100 ms. While clients
// of a program that holds too many connections connect again and again, others would find no place for seconds.
constexpr int kLocalBacklog = 4096;

Result<void> ListenOnIpc(ZmqSocket& router, const std::string& endpoint) {
  router.Set(ZMQ_BACKLOG, kLocalBacklog);
  if (const auto made = MakePrivateFolder(std::filesystem::path(SocketFileOf(endpoint)).parent_path()); !made)
    return made;
  if (const auto claimed = ClaimIpcPath(endpoint); !claimed) return claimed;
  return router.Bind(endpoint);
}

Result<void> ListenWithKeys(ZmqSocket& router, const std::string& endpoint, const std::string& secret_key) {
  router.Set(ZMQ_CURVE_SERVER, 1);
  router.Set(ZMQ_CURVE_SECRETKEY, secret_key);
  router.Set(ZMQ_ZAP_DOMAIN, ZapHandler::kClientDomain);
  // Close connections that never finish the handshake, and connections whose machine has disappeared.
  router.Set(ZMQ_HANDSHAKE_IVL, kHandshakeMax_ms);
  router.Set(ZMQ_TCP_KEEPALIVE, 1);
  router.Set(ZMQ_TCP_KEEPALIVE_IDLE, kClientKeepAlive_s);
  if (endpoint.find('[') != std::string::npos) router.Set(ZMQ_IPV6, 1);
  const Result<std::string> numeric = NumericEndpoint(endpoint);
  if (!numeric) return tl::unexpected(numeric.error());
  return router.Bind(*numeric);
}

// Returns the number in a routing id that a ROUTER assigned: a zero byte followed by 32 bits, big-endian. Returns
// nothing for an id of another form.
std::optional<std::uint32_t> NumberOf(std::string_view routing_id) {
  if (routing_id.size() != 5 || routing_id[0] != '\0') return std::nullopt;
  std::uint32_t number = 0;
  for (const char byte : routing_id.substr(1)) number = number << 8 | static_cast<std::uint8_t>(byte);
  return number;
}

// Connects to `router` inside this process and returns the number that the router assigns to this first connection.
Result<std::uint32_t> FirstNumberOf(const ZmqContext& context, ZmqSocket& router) {
  const std::string endpoint = "inproc://first-client";
  if (const auto bound = router.Bind(endpoint); !bound) return tl::unexpected(bound.error());
  Result<ZmqSocket> dealer = ZmqSocket::Make(context, ZMQ_DEALER);
  if (!dealer) return tl::unexpected(dealer.error());
  if (const auto connected = dealer->Connect(endpoint); !connected) return tl::unexpected(connected.error());
  ZmqFrame frame("first");
  ZmqReceived received;
  const bool is_there = dealer->Send(&frame) == ZmqSend::kSent && router.Receive(&received);
  const std::optional<std::uint32_t> number = is_there ? NumberOf(received.route.text()) : std::nullopt;
  if (!number) return Fail(ErrorCode::kUnavailable, "this build of libzmq does not number its connections");
  router.Unbind(endpoint);
  return *number;
}

// Returns the error that replaces a reply that is too large to send.
proto::Message TooLarge(const proto::Message& reply, std::size_t bytes, std::size_t bytes_max) {
  proto::Message message = ErrorMessage({ErrorCode::kFull,
                                         "the reply has " + std::to_string(bytes) + " bytes, more than the " +
                                             std::to_string(bytes_max) + " of a message; ask for less at a time",
                                         ""});
  message.set_agent_id(reply.agent_id());
  message.set_hop_sender(reply.hop_sender());
  message.set_request_id(reply.request_id());
  return message;
}

}  // namespace

Result<std::unique_ptr<ClientListener>> ClientListener::Open(const ZmqContext& context, WakeUp& wake_up,
                                                             Options options) {
  const bool is_ipc = options.endpoint.starts_with(kIpc);
  Check(is_ipc == (options.identity_of == nullptr), "clients come over ipc, or with a key");
  Result<ZmqSocket> router = ZmqSocket::Make(context, ZMQ_ROUTER);
  if (!router) return tl::unexpected(router.error());
  // With this option, a send to a client that left or does not read fails immediately.
  router->Set(ZMQ_ROUTER_MANDATORY, 1);
  router->Set(ZMQ_RCVHWM, is_ipc ? kQueueMessages : kKeyedRequestsWaiting);
  router->Set(ZMQ_SNDHWM, is_ipc ? kQueueMessages : kKeyedRepliesWaiting);
  const std::size_t request_bytes_max =
      is_ipc ? options.message_bytes_max : std::min(options.message_bytes_max, kKeyedRequestBytesMax);
  router->SetInt64(ZMQ_MAXMSGSIZE, static_cast<std::int64_t>(request_bytes_max));
  Result<std::uint32_t> first_id = 0;
  if (!is_ipc) {
    first_id = FirstNumberOf(context, *router);
    if (!first_id) return tl::unexpected(first_id.error());
  }
  if (options.before_listening) {
    if (const auto ready = options.before_listening(*router); !ready) return tl::unexpected(ready.error());
  }
  const auto bound =
      is_ipc ? ListenOnIpc(*router, options.endpoint) : ListenWithKeys(*router, options.endpoint, options.secret_key);
  if (!bound) return tl::unexpected(bound.error());
  return std::unique_ptr<ClientListener>(
      new ClientListener(std::move(*router), *first_id, wake_up, std::move(options)));
}

ClientListener::ClientListener(ZmqSocket router, std::uint32_t first_id, WakeUp& wake_up, Options options)
    : options_(std::move(options)),
      router_(std::move(router)),
      first_id_(first_id),
      wake_up_(wake_up),
      table_(kClientsMax, is_keyed() ? kConnectionsOfKeyMax : kClientsMax, is_keyed() ? kKeyedPrefix : "") {}

ClientListener::~ClientListener() {
  if (!is_keyed() && is_listening_) (void)::unlink(SocketFileOf(options_.endpoint).c_str());
}

SendResult ClientListener::Send(const std::string& name, const proto::Message& message) {
  const std::optional<std::string> routing_id = table_.RoutingIdOf(name);
  if (!routing_id) return SendResult::kUnreachable;
  const std::size_t bytes = message.ByteSizeLong();
  SendResult result = SendResult::kFull;
  if (bytes <= options_.message_bytes_max) {
    result = Push(name, *routing_id, message, bytes);
  } else {
    const proto::Message error = TooLarge(message, bytes, options_.message_bytes_max);
    (void)Push(name, *routing_id, error, error.ByteSizeLong());
  }
  wake_up_.RingFor();
  return result;
}

SendResult ClientListener::Push(const std::string& name, const std::string& routing_id, const proto::Message& message,
                                std::size_t bytes) {
  Reply reply{ZmqFrame(routing_id), ToClientFrame(message, bytes), is_keyed() ? table_.OwnerOf(name) : "", bytes};
  const std::lock_guard lock(mutex_);
  const bool is_full = replies_.size() >= kRepliesMax || reply_bytes_ + bytes > options_.message_bytes_max;
  if (is_full && !replies_.empty()) return SendResult::kFull;
  reply_bytes_ += bytes;
  if (is_keyed()) unread_.AddWaiting(reply.key, bytes);
  replies_.push_back(std::move(reply));
  return SendResult::kAccepted;
}

std::uint64_t ClientListener::UnreadBytes(const std::string& name) {
  const std::string key = is_keyed() ? table_.OwnerOf(name) : "";
  return key.empty() ? 0 : unread_.OfKey(key);
}

bool ClientListener::has_replies() const {
  const std::lock_guard lock(mutex_);
  return !replies_.empty();
}

void ClientListener::KeepPlace(std::chrono::steady_clock::time_point now) {
  if (is_keyed() || now < looks_at_) return;
  looks_at_ = now + kPlacePeriod;
  if (!is_listening_) {
    const auto listening = ListenOnIpc(router_, options_.endpoint);
    is_listening_ = listening.has_value();
    log_.Warn(is_listening_ ? "transport: listens for clients again" : "transport: " + ToString(listening.error()));
    return;
  }
  struct stat status {};
  const std::filesystem::path path = SocketFileOf(options_.endpoint);
  if (::lstat(path.c_str(), &status) == 0 || errno != ENOENT) return;
  log_.Warn("transport: the socket for clients was removed: " + path.string());
  // Listen again later: libzmq closes the old socket asynchronously. Some versions then delete the file, and would
  // delete a new one too.
  router_.Unbind(options_.endpoint);
  is_listening_ = false;
}

// Receive last: sending may consume libzmq's notification of new requests.
bool ClientListener::Work(const Transport::Deliver& deliver) {
  Flush();
  return Receive(deliver) || has_replies();
}

bool ClientListener::Receive(const Transport::Deliver& deliver) {
  ZmqReceived received;
  for (int i = 0; i < kClientBatchMessages; ++i) {
    if (!router_.Receive(&received)) return false;
    OnFrame(received, deliver);
  }
  return true;
}

bool ClientListener::HasAssigned(std::string_view routing_id) const {
  const std::optional<std::uint32_t> number = NumberOf(routing_id);
  if (!number) return false;
  const std::uint32_t place = *number - first_id_;
  return place > 0 && place <= options_.admitted_handshakes();
}

void ClientListener::OnFrame(const ZmqReceived& received, const Transport::Deliver& deliver) {
  if (is_keyed()) {
    const bool has_claimed_id = !HasAssigned(received.route.text());
    options_.on_message(received.file, received.frame.user_id(), has_claimed_id);
    if (has_claimed_id) return;
  }
  if (received.parts != 1) return log_.Warn("transport: a client sent a frame of several parts");
  const std::string route(received.route.text());
  const std::string key(received.frame.user_id());
  const std::string name = table_.NameOf(route, key);
  if (is_keyed()) unread_.OnRequest(route, key, received.file);
  // Only this user can connect over ipc, and has all rights.
  ClientIdentity client{proto::CLIENT_RIGHTS_COMMAND, {}};
  if (is_keyed()) client = options_.identity_of(std::string(received.frame.user_id()));
  if (client.rights == proto::CLIENT_RIGHTS_NONE && received.frame.size() > kRefusedBytesMax) {
    return log_.Warn("transport: dropped a large request of a client whose key is not listed");
  }
  Result<OwnedMessage> message = ParseClientFrame(received.frame.text(), name, client, options_.self);
  if (!message) return log_.Warn("transport: a client " + message.error().text);
  if (options_.on_local_request) options_.on_local_request(received.file, route);
  deliver(std::move(*message));
}

void ClientListener::Flush() {
  std::deque<Reply> replies;
  {
    const std::lock_guard lock(mutex_);
    replies.swap(replies_);
    reply_bytes_ = 0;
  }
  const auto now = std::chrono::steady_clock::now();
  if (!held_.empty() && now >= tries_held_at_) RetryHeld(now);
  for (Reply& reply : replies) {
    if (Hand(reply)) {
      Settle(reply);
    } else {
      Hold(std::move(reply));
    }
  }
}

void ClientListener::RetryHeld(std::chrono::steady_clock::time_point now) {
  tries_held_at_ = now + kHeldPeriod;
  // By key: the size of the smallest reply that had no room. Larger ones are not tried, because each try reads the
  // state of all connections.
  std::map<std::string, std::size_t> too_large;
  for (Reply& reply : std::exchange(held_, {})) {
    const auto known = too_large.find(reply.key);
    const bool has_no_room = known != too_large.end() && reply.bytes >= known->second;
    if (now - reply.held_since > kHeldMax) {
      log_.Warn(kDropsReply);
      Settle(reply);
    } else if (!has_no_room && Hand(reply)) {
      Settle(reply);
    } else {
      if (!has_no_room) too_large[reply.key] = reply.bytes;
      held_.push_back(std::move(reply));
    }
  }
}

void ClientListener::Settle(const Reply& reply) {
  if (is_keyed()) unread_.RemoveWaiting(reply.key, reply.bytes);
}

bool ClientListener::Hand(Reply& reply) {
  const std::string routing_id(reply.route.text());
  if (is_keyed() && !unread_.HasRoom(routing_id, reply.bytes)) return false;
  ZmqSend sent = router_.Send(&reply.route, /*has_more=*/true);
  if (sent == ZmqSend::kSent) sent = router_.Send(&reply.frame);
  if (sent == ZmqSend::kSent && is_keyed()) unread_.Count(routing_id, reply.bytes);
  if (sent == ZmqSend::kSent && options_.on_local_reply) options_.on_local_reply(routing_id);
  if (sent == ZmqSend::kNoRoute) table_.Forget(routing_id);
  if (sent != ZmqSend::kWouldBlock) return true;
  if (is_keyed()) return false;  // The route is unchanged, so the reply can be tried again.
  log_.Warn(kDropsReply);
  return true;
}

// The limits of bytes are those of UnreadReplies.
void ClientListener::Hold(Reply reply) {
  std::size_t of_key = 0;
  std::size_t of_all = 0;
  std::size_t count_of_key = 0;
  for (const Reply& held : held_) {
    of_all += held.bytes;
    if (held.key != reply.key) continue;
    of_key += held.bytes;
    ++count_of_key;
  }
  const bool has_room = (of_key == 0 || of_key + reply.bytes <= UnreadReplies::kOfKeyMax) &&
                        (of_all == 0 || of_all + reply.bytes <= UnreadReplies::kOfAllMax);
  if (!has_room || count_of_key >= kHeldOfKeyMax || held_.size() >= kRepliesMax) {
    Settle(reply);
    return log_.Warn(kDropsReply);
  }
  reply.held_since = std::chrono::steady_clock::now();
  if (held_.empty()) tries_held_at_ = reply.held_since + kHeldPeriod;
  held_.push_back(std::move(reply));
}

std::chrono::steady_clock::time_point ClientListener::deadline() const {
  auto deadline = std::chrono::steady_clock::time_point::max();
  if (!is_listening_) deadline = looks_at_;
  return held_.empty() ? deadline : std::min(deadline, tries_held_at_);
}

}  // namespace moondb
