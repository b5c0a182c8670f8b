#include "runtime/transport/zap_handler.h"

#include <zmq.h>

#include <array>
#include <charconv>

namespace moondb {
namespace {

constexpr char kEndpoint[] = "inproc://zeromq.zap.01";

// A request's parts.
enum Part : std::size_t { kVersion, kRequestId, kDomain, kPeerAddress, kRoutingId, kMechanism, kKey, kPartCount };

}  // namespace

Result<ZapHandler> ZapHandler::Make(const ZmqContext& context, std::map<std::string, AgentId> agents,
                                    OnRefused on_refused) {
  Result<ZmqSocket> socket = ZmqSocket::Make(context, ZMQ_REP);
  if (!socket) return tl::unexpected(socket.error());
  if (const Result<void> bound = socket->Bind(kEndpoint); !bound) return tl::unexpected(bound.error());
  return ZapHandler(std::move(*socket), std::move(agents), std::move(on_refused));
}

void ZapHandler::OnReadable() {
  for (std::vector<ZmqFrame> request; socket_.Receive(&request);) {
    const std::optional<std::string> user = UserOf(request);
    const bool is_client = request.size() > kDomain && request[kDomain].text() == kClientDomain;
    if (!user) on_refused_(is_client);
    const std::array<std::string, 6> reply = {
        "1.0",
        std::string(request.size() > kRequestId ? request[kRequestId].text() : ""),
        user ? "200" : "400",
        user ? "OK" : "this key is not known here",
        user.value_or(""),
        /*metadata=*/""};
    for (std::size_t i = 0; i < reply.size(); ++i) {
      ZmqFrame frame(reply[i]);
      (void)socket_.Send(&frame, /*has_more=*/i + 1 < reply.size());
    }
  }
}

std::optional<std::string> ZapHandler::UserOf(const std::vector<ZmqFrame>& request) const {
  if (request.size() != kPartCount || request[kVersion].text() != "1.0" || request[kMechanism].text() != "CURVE") {
    return std::nullopt;
  }
  std::array<char, 41> text{};
  const std::string_view key = request[kKey].text();
  if (key.size() != 32) return std::nullopt;
  zmq_z85_encode(text.data(), reinterpret_cast<const std::uint8_t*>(key.data()), key.size());
  if (request[kDomain].text() == kClientDomain) {
    return is_client_ && is_client_(text.data()) ? std::optional<std::string>(text.data()) : std::nullopt;
  }
  const auto agent = agents_.find(text.data());
  return agent == agents_.end() ? std::nullopt : std::optional(std::to_string(agent->second));
}

AgentId AgentOfUserId(std::string_view user_id) {
  AgentId agent = 0;
  const auto [end, error] = std::from_chars(user_id.data(), user_id.data() + user_id.size(), agent);
  return error == std::errc() && end == user_id.data() + user_id.size() ? agent : 0;
}

}  // namespace moondb
