#include "runtime/inbound.h"

#include <memory>
#include <utility>

#include "runtime/address.h"

namespace moondb {
namespace {

// proto/message.proto numbers its bodies in groups: from Timer on those of the runtime and of storage, which never
// leave their agent, then from Hello on those between agents.
bool IsWithinAgent(const proto::Message& message) {
  return message.body_case() >= proto::Message::kTimer && message.body_case() < proto::Message::kHello;
}

Result<std::shared_ptr<proto::Message>> Parse(std::string_view frame) {
  auto message = std::make_shared<proto::Message>();
  if (!message->ParseFromArray(frame.data(), static_cast<int>(frame.size())))
    return Fail(ErrorCode::kCorrupt, "sent a frame that does not decode");
  if (IsWithinAgent(*message)) return Fail(ErrorCode::kRefused, "sent a message that must not leave its agent");
  return message;
}

}  // namespace

Result<MessagePtr> ParsePeerFrame(std::string_view frame, std::optional<AgentId> authenticated) {
  Result<std::shared_ptr<proto::Message>> message = Parse(frame);
  if (!message) return tl::unexpected(message.error());
  const AgentId claimed = (*message)->hop_sender();
  if (authenticated && claimed != *authenticated) {
    return Fail(ErrorCode::kRefused, "claimed to be agent " + std::to_string(claimed));
  }
  return MessagePtr(std::move(*message));
}

Result<MessagePtr> ParseClientFrame(std::string_view frame, const std::string& connection, AgentId self) {
  Result<std::shared_ptr<proto::Message>> parsed = Parse(frame);
  if (!parsed) return tl::unexpected(parsed.error());
  proto::Message& message = **parsed;
  if (message.has_link_report()) return Fail(ErrorCode::kRefused, "sent a message that only peers' transports send");
  message.set_agent_id(self);
  message.set_hop_sender(kClients);
  message.set_source_actor(connection);
  message.set_destination_id(self);
  message.set_destination_actor(actor_name::kGateway);
  message.clear_term();
  message.clear_record_id();
  message.clear_sql();
  return MessagePtr(std::move(*parsed));
}

}  // namespace moondb
