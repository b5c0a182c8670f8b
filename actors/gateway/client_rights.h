// What a client's key, and an agent that relays a request, must be allowed for it. Plain functions, any thread.
#pragma once

#include "model/error.h"
#include "model/ids.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// CLIENT_RIGHTS_VIEW for what changes nothing, SHARE for what robots and planners do, COMMAND for the rest, as
// proto/control.proto says at each request.
proto::ClientRights RightsNeededFor(proto::ControlRequest::RequestCase request);

// kRefused where the key of the client that sent the message does not allow such a request: the text says what it
// allows and what is needed.
Result<void> CheckClientRights(const proto::Message& message, proto::ControlRequest::RequestCase request);

// kRefused where agent `from` may not relay such a request to the agent `self`, whoever asked it to: what changes
// nothing is any agent's to ask; the rest needs `command_from` of the team file, but for sharing, which leader and
// survivor of `roles` order too. The text names the line of the team file that would allow it.
Result<void> CheckRelayRights(const proto::TeamConfig& team, AgentId self, const proto::RoleAssignment& roles,
                              AgentId from, const proto::ControlRequest& request);

}  // namespace moondb
