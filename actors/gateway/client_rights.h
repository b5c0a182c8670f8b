// Checks whether a client's key, or the agent that relays a request, has the rights that the request needs.
// Thread-safe.
#pragma once

#include <map>

#include "model/error.h"
#include "model/ids.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// Returns the rights that proto/control.proto declares for the request: CLIENT_RIGHTS_VIEW if the request changes
// nothing, SHARE for requests of robots and planners, and COMMAND for all others.
proto::ClientRights RightsNeededFor(proto::ControlRequest::RequestCase request);

// Returns kRefused if the key of the client that sent the message does not allow this request. The text names the key's
// rights and the required rights.
Result<void> CheckClientRights(const proto::Message& message, proto::ControlRequest::RequestCase request);

// Returns kRefused if agent `from` may not relay this request to agent `self`. An agent that has left the team may
// relay nothing. Every other agent may relay requests that change nothing. Agents in `command_from` of the team file
// may relay all requests. The leader and the survivor of `roles` may also relay requests to share.
Result<void> CheckRelayRights(const proto::TeamConfig& team, AgentId self, const proto::RoleAssignment& roles,
                              AgentId from, const proto::ControlRequest& request);

// Adds one entry to the status for each agent whose relayed commands were refused. `refused`: their number by agent.
void AddRefusedCommands(const std::map<AgentId, double>& refused, proto::AgentStatus& status);

}  // namespace moondb
