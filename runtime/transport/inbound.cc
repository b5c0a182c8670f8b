#include "runtime/transport/inbound.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/unknown_field_set.h>

#include <utility>

#include "model/bounded_parse.h"
#include "runtime/address.h"
#include "runtime/transport/outbound.h"

namespace moondb {
namespace {

// Returns true for bodies that agents and clients may send. A client's request to another agent travels as a
// ControlRequest, which the other agent's gateway checks. Users' own actors communicate with `custom`. All other bodies
// are internal to one agent.
bool MayComeFromOutside(const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kHello:
    case proto::Message::kHave:
    case proto::Message::kBatch:
    case proto::Message::kRefusal:
    case proto::Message::kShareRequest:
    case proto::Message::kShareReply:
    case proto::Message::kRoleAnnounce:
    case proto::Message::kRoleChainRequest:
    case proto::Message::kRoleChainReply:
    case proto::Message::kLeaseAnnounce:
    case proto::Message::kLinkReport:
    case proto::Message::kClockReport:
    case proto::Message::kEpochReport:
    case proto::Message::kLeaderCheck:
    case proto::Message::kControlRequest:
    case proto::Message::kControlReply:
    case proto::Message::kCustom:
    case proto::Message::BODY_NOT_SET:
      return true;
    default:
      return false;
  }
}

// Removes unknown fields. Nothing reads them, and a reused message would keep their memory (OwnedMessage).
void DropUnknownFields(proto::Message* message) {
  const auto* reflection = message->GetReflection();
  if (reflection->GetUnknownFields(*message).empty()) return;
  google::protobuf::UnknownFieldSet dropped;
  reflection->MutableUnknownFields(message)->Swap(&dropped);
}

using ParseFunction = bool (*)(std::string_view bytes, google::protobuf::Message* message);

Result<void> Parse(std::string_view bytes, ParseFunction parse, proto::Message* message) {
  if (!parse(bytes, message)) return Fail(ErrorCode::kCorrupt, "sent a frame that does not decode");
  DropUnknownFields(message);
  if (!MayComeFromOutside(*message))
    return Fail(ErrorCode::kRefused, "sent a message that is valid only within one agent");
  return {};
}

// Removes and returns the bytes of the next message at the front of a PeerFrame. Returns nothing if the frame is
// malformed.
std::optional<std::string_view> TakeMessage(std::string_view* frame) {
  google::protobuf::io::CodedInputStream stream(reinterpret_cast<const std::uint8_t*>(frame->data()),
                                                static_cast<int>(frame->size()));
  std::uint32_t length = 0;
  if (stream.ReadTag() != kPeerFrameTag || !stream.ReadVarint32(&length)) return std::nullopt;
  const std::string_view rest = frame->substr(static_cast<std::size_t>(stream.CurrentPosition()));
  if (length > rest.size()) return std::nullopt;
  *frame = rest.substr(length);
  return rest.substr(0, length);
}

}  // namespace

std::optional<std::uint32_t> TakeLinkNumber(std::string_view* frame) {
  if (frame->size() < kLinkNumberBytes || frame->front() != kLinkNumberTag) return std::nullopt;
  std::uint32_t link_number = 0;
  google::protobuf::io::CodedInputStream::ReadLittleEndian32FromArray(
      reinterpret_cast<const std::uint8_t*>(frame->data() + 1), &link_number);
  if (link_number == 0) return std::nullopt;
  frame->remove_prefix(kLinkNumberBytes);
  return link_number;
}

Result<std::vector<OwnedMessage>> ParsePeerFrame(std::string_view frame, std::optional<AgentId> authenticated) {
  const bool may_be_shared = frame.size() <= kSharedFrameBytesMax;
  std::vector<OwnedMessage> messages;
  do {
    const std::optional<std::string_view> bytes = TakeMessage(&frame);
    if (!bytes || (!frame.empty() && !may_be_shared)) {
      return Fail(ErrorCode::kCorrupt, "sent a frame that does not decode");
    }
    OwnedMessage message;
    const auto parsed = Parse(*bytes, ParseBoundedFromPeer, &*message);
    if (!parsed) return tl::unexpected(parsed.error());
    if (authenticated && message->hop_sender() != *authenticated) {
      return Fail(ErrorCode::kRefused, "claimed to be agent " + std::to_string(message->hop_sender()));
    }
    if (!messages.empty() && message->hop_sender() != messages.front()->hop_sender()) {
      return Fail(ErrorCode::kRefused, "sent a frame with messages of several senders");
    }
    if (message->has_link_report() && !(messages.empty() && frame.empty())) {
      return Fail(ErrorCode::kCorrupt, "sent a link report in one frame with other messages");
    }
    message->clear_client_rights();
    message->clear_client_name();
    messages.push_back(std::move(message));
  } while (!frame.empty());
  return messages;
}

Result<OwnedMessage> ParseClientFrame(std::string_view frame, const std::string& connection,
                                      const ClientIdentity& client, AgentId self) {
  OwnedMessage received;
  proto::Message& message = *received;
  if (const auto parsed = Parse(frame, ParseBounded, &message); !parsed) return tl::unexpected(parsed.error());
  if (message.has_link_report()) return Fail(ErrorCode::kRefused, "sent a link report, which only agents may send");
  message.set_agent_id(self);
  message.set_hop_sender(kClients);
  message.set_source_actor(connection);
  message.set_destination_id(self);
  message.set_destination_actor(actor_name::kGateway);
  message.set_client_rights(client.rights);
  message.set_client_name(client.name);
  message.clear_term();
  message.clear_record_id();
  message.clear_sql();
  return received;
}

}  // namespace moondb
