#include "runtime/transport/zap_handler.h"

#include <zmq.h>

#include <array>
#include <charconv>
#include <utility>

namespace moondb {
namespace {

constexpr char kEndpoint[] = "inproc://zeromq.zap.01";

// Message parts of a ZAP request, in order.
enum Part : std::size_t { kVersion, kRequestId, kDomain, kPeerAddress, kRoutingId, kMechanism, kKey, kPartCount };

// ZAP status code and text for each ZapHandler::Admission.
constexpr std::array<std::pair<const char*, const char*>, 3> kStatus = {
    {{"200", "OK"},
     {"400", "this key is not listed at this agent"},
     {"300", "this key has reached its limit of connections"}}};

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
    const Answer answer = Ask(request);
    const bool is_client = request.size() > kDomain && request[kDomain].text() == kClientDomain;
    if (answer.admission == Admission::kUnknown) on_refused_(is_client);
    const auto& [code, text] = kStatus.at(static_cast<std::size_t>(answer.admission));
    const std::array<std::string, 6> reply = {
        "1.0",          std::string(request.size() > kRequestId ? request[kRequestId].text() : ""), code, text,
        answer.user_id,
        /*metadata=*/""};
    for (std::size_t i = 0; i < reply.size(); ++i) {
      ZmqFrame frame(reply[i]);
      (void)socket_.Send(&frame, /*has_more=*/i + 1 < reply.size());
    }
  }
}

ZapHandler::Answer ZapHandler::Ask(const std::vector<ZmqFrame>& request) const {
  if (request.size() != kPartCount || request[kVersion].text() != "1.0" || request[kMechanism].text() != "CURVE") {
    return {};
  }
  std::array<char, 41> text{};
  const std::string_view key = request[kKey].text();
  if (key.size() != 32) return {};
  zmq_z85_encode(text.data(), reinterpret_cast<const std::uint8_t*>(key.data()), key.size());
  if (request[kDomain].text() == kClientDomain) {
    if (!admit_client_) return {};
    const Admission admission = admit_client_(text.data(), std::string(request[kPeerAddress].text()));
    return {admission, admission == Admission::kAdmitted ? text.data() : ""};
  }
  const auto agent = agents_.find(text.data());
  if (agent == agents_.end()) return {};
  return {Admission::kAdmitted, std::to_string(agent->second)};
}

AgentId AgentOfUserId(std::string_view user_id) {
  AgentId agent = 0;
  const auto [end, error] = std::from_chars(user_id.data(), user_id.data() + user_id.size(), agent);
  return error == std::errc() && end == user_id.data() + user_id.size() ? agent : 0;
}

}  // namespace moondb
