#include "model/control_message.h"

#include <string>

#include "model/bounded_parse.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"

namespace moondb {
namespace {

template <typename Control>
Result<Control> Parse(bool is_there, const std::string& bytes, const std::string& what) {
  if (!is_there) return Fail(ErrorCode::kInvalid, "the message holds no control " + what, what);
  Control control;
  if (ParseBounded(bytes, &control)) return control;
  return Fail(ErrorCode::kCorrupt, "the control " + what + " does not decode, or has too many parts", what);
}

}  // namespace

proto::Message MessageOf(const proto::ControlRequest& request) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  request.SerializeToString(message.mutable_control_request());
  return message;
}

proto::Message MessageOf(const proto::ControlReply& reply) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  reply.SerializeToString(message.mutable_control_reply());
  return message;
}

proto::Message ErrorMessage(const Error& error) {
  proto::ControlReply reply;
  *reply.mutable_error() = ToProto(error);
  return MessageOf(reply);
}

Result<proto::ControlRequest> ControlRequestOf(const proto::Message& message) {
  return Parse<proto::ControlRequest>(message.body_case() == proto::Message::kControlRequest, message.control_request(),
                                      "request");
}

Result<proto::ControlReply> ControlReplyOf(const proto::Message& message) {
  return Parse<proto::ControlReply>(message.body_case() == proto::Message::kControlReply, message.control_reply(),
                                    "reply");
}

Result<void> CheckControlReply(const proto::Message& message) {
  const Result<proto::ControlReply> reply = ControlReplyOf(message);
  if (!reply) return tl::unexpected(reply.error());
  if (IsError(reply->error())) return tl::unexpected(FromProto(reply->error()));
  return {};
}

}  // namespace moondb
