// What a client's key must allow for a request. Plain functions, any thread.
#pragma once

#include "model/error.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"

namespace moondb {

// CLIENT_RIGHTS_VIEW for what changes nothing, SHARE for what robots and planners do, COMMAND for the rest, as
// proto/control.proto says at each request.
proto::ClientRights RightsNeededFor(proto::ControlRequest::RequestCase request);

// kRefused where the key of the client that sent the message does not allow such a request: the text says what it
// allows and what is needed.
Result<void> CheckClientRights(const proto::Message& message, proto::ControlRequest::RequestCase request);

}  // namespace moondb
