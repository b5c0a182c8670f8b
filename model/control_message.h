// A ControlRequest or a ControlReply as the body of a Message, where it is serialised: whoever carries a Message knows
// nothing of what clients ask. Between a client and its agent the frame is a ClientMessage of proto/control.proto,
// which has the same bytes. Plain functions, any thread; include proto/control.pb.h to look into what they give.
#pragma once

#include "model/error.h"

namespace moondb::proto {
class ControlReply;
class ControlRequest;
class Message;
}  // namespace moondb::proto

namespace moondb {

// Of the type CONTROL, and without a request id.
proto::Message MessageOf(const proto::ControlRequest& request);
proto::Message MessageOf(const proto::ControlReply& reply);
// A ControlReply that holds nothing but the error.
proto::Message ErrorMessage(const Error& error);

// kInvalid where the message has another body; kCorrupt where the body does not decode or would take too much memory
// (model/bounded_parse.h).
Result<proto::ControlRequest> ControlRequestOf(const proto::Message& message);
Result<proto::ControlReply> ControlReplyOf(const proto::Message& message);
// Fails with the error that a ControlReply holds, or as above.
Result<void> CheckControlReply(const proto::Message& message);

}  // namespace moondb
