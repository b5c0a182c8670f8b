#include "runtime/transport/outbound.h"

#include <google/protobuf/io/coded_stream.h>

#include "model/data_types.h"
#include "model/ids.h"

namespace moondb {
namespace {

std::string KeyOf(const proto::Message& message, int variant) {
  return std::to_string(message.body_case()) + '/' + std::to_string(variant) + '/' + message.source_actor() + '/' +
         message.destination_actor();
}

}  // namespace

std::size_t OutboundClassOf(const proto::Message& message) {
  if (message.ms_type() == proto::CONTROL || message.ms_type() == proto::ACKNOWLEDGMENT) return kControlClass;
  return 1 + static_cast<std::size_t>(SharingRank(message.data_type()));
}

std::string ReplaceKeyOf(const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kRoleAnnounce:
      return KeyOf(message, message.role_announce().is_reply() ? 1 : 0);
    case proto::Message::kRoleChainRequest:
    case proto::Message::kRoleChainReply:
      return KeyOf(message, 0);
    case proto::Message::kHello:
      return KeyOf(message, message.hello().kind());
    case proto::Message::kLeaseAnnounce:
      return KeyOf(message, message.lease_announce().is_reply() ? 1 : 0);
    default:
      return "";
  }
}

std::string ToPeerFrame(const proto::Message& message) {
  using google::protobuf::io::CodedOutputStream;
  const auto bytes = static_cast<std::uint32_t>(message.ByteSizeLong());
  std::string frame(kPeerFrameTagBytes + CodedOutputStream::VarintSize32(bytes) + bytes, '\0');
  auto* end = reinterpret_cast<std::uint8_t*>(frame.data());
  end = CodedOutputStream::WriteTagToArray(kPeerFrameTag, end);
  end = CodedOutputStream::WriteVarint32ToArray(bytes, end);
  message.SerializeWithCachedSizesToArray(end);
  return frame;
}

void WriteLinkNumber(std::uint32_t link_number, char* to) {
  *to = kLinkNumberTag;
  google::protobuf::io::CodedOutputStream::WriteLittleEndian32ToArray(link_number,
                                                                      reinterpret_cast<std::uint8_t*>(to + 1));
}

ZmqFrame ToClientFrame(const proto::Message& message, std::size_t bytes) {
  ZmqFrame frame(bytes);
  message.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(frame.data()));
  return frame;
}

}  // namespace moondb
