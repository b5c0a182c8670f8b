#include "runtime/zap_handler.h"

#include <zmq.h>

#include <array>
#include <charconv>

namespace moondb {
namespace {

constexpr char kEndpoint[] = "inproc://zeromq.zap.01";

// A request's parts.
enum Part : std::size_t { kVersion, kRequestId, kDomain, kPeerAddress, kRoutingId, kMechanism, kKey, kPartCount };

}  // namespace

Result<ZapHandler> ZapHandler::Make(const ZmqContext& context, std::map<std::string, AgentId> agents) {
  Result<ZmqSocket> socket = ZmqSocket::Make(context, ZMQ_REP);
  if (!socket) return tl::unexpected(socket.error());
  if (const Result<void> bound = socket->Bind(kEndpoint); !bound) return tl::unexpected(bound.error());
  return ZapHandler(std::move(*socket), std::move(agents));
}

void ZapHandler::OnReadable() {
  for (ZmqParts request; socket_.Receive(&request);) {
    const std::optional<AgentId> agent = AgentOf(request.parts);
    if (!agent) ++refused_;
    const std::string version = "1.0";
    const std::string request_id = request.parts.size() > kRequestId ? request.parts[kRequestId] : "";
    const std::string code = agent ? "200" : "400";
    const std::string text = agent ? "OK" : "no agent of the team has this key";
    const std::string user_id = agent ? std::to_string(*agent) : "";
    const std::string metadata;
    (void)socket_.Send({&version, &request_id, &code, &text, &user_id, &metadata});
  }
}

std::optional<AgentId> ZapHandler::AgentOf(const std::vector<std::string>& request) const {
  if (request.size() != kPartCount || request[kVersion] != "1.0" || request[kMechanism] != "CURVE") return std::nullopt;
  std::array<char, 41> text{};
  if (request[kKey].size() != 32) return std::nullopt;
  zmq_z85_encode(text.data(), reinterpret_cast<const std::uint8_t*>(request[kKey].data()), request[kKey].size());
  const auto agent = agents_.find(text.data());
  return agent == agents_.end() ? std::nullopt : std::optional(agent->second);
}

AgentId AgentOfUserId(const std::string& user_id) {
  AgentId agent = 0;
  const auto [end, error] = std::from_chars(user_id.data(), user_id.data() + user_id.size(), agent);
  return error == std::errc() && end == user_id.data() + user_id.size() ? agent : 0;
}

}  // namespace moondb
