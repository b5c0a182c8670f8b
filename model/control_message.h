// Converts between a Message and the ControlRequest or ControlReply that it holds as bytes. Code that only forwards a
// Message therefore does not depend on proto/control.proto. A client and its agent exchange a ClientMessage
// (proto/control.proto), which has the same encoding. Include proto/control.pb.h to access the fields of requests and
// replies. Thread-safe.
#pragma once

#include "model/error.h"

namespace moondb::proto {
class ControlReply;
class ControlRequest;
class Message;
}  // namespace moondb::proto

namespace moondb {

// Return a message of the type CONTROL, without a request id.
proto::Message MessageOf(const proto::ControlRequest& request);
proto::Message MessageOf(const proto::ControlReply& reply);
// Returns a message with a ControlReply that holds only the error.
proto::Message ErrorMessage(const Error& error);

// Return the request or reply in `message`. Fail with kInvalid if the message has another body, and with kCorrupt if
// the body does not decode or would need too much memory (model/bounded_parse.h).
Result<proto::ControlRequest> ControlRequestOf(const proto::Message& message);
Result<proto::ControlReply> ControlReplyOf(const proto::Message& message);
// If the ControlReply in `message` holds an error, fails with that error. Also fails like ControlReplyOf.
Result<void> CheckControlReply(const proto::Message& message);

}  // namespace moondb
