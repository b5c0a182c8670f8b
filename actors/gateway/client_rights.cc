#include "actors/gateway/client_rights.h"

#include "model/agent_name.h"
#include "model/command_from.h"
#include "model/control_request.h"
#include "model/rights_name.h"
#include "model/team_member.h"

namespace moondb {

proto::ClientRights RightsNeededFor(proto::ControlRequest::RequestCase request) {
  const proto::ClientRights rights = CommandOptionsOf(request).rights();
  return rights == proto::CLIENT_RIGHTS_NONE ? proto::CLIENT_RIGHTS_COMMAND : rights;
}

Result<void> CheckClientRights(const proto::Message& message, proto::ControlRequest::RequestCase request) {
  const proto::ClientRights needed = RightsNeededFor(request);
  const proto::ClientRights has = message.client_rights();
  if (has >= needed) return {};
  if (has == proto::CLIENT_RIGHTS_NONE) return Fail(ErrorCode::kRefused, "your key is no longer listed at this agent");
  return Fail(ErrorCode::kRefused, "this needs the right to " + RightsName(needed) + "; the key of " +
                                       message.client_name() + " has the right to " + RightsName(has));
}

Result<void> CheckRelayRights(const proto::TeamConfig& team, AgentId self, const proto::RoleAssignment& roles,
                              AgentId from, const proto::ControlRequest& request) {
  if (HasLeft(team, from)) return Fail(ErrorCode::kRefused, AgentName(team, from) + " has left the team");
  if (RightsNeededFor(request.request_case()) == proto::CLIENT_RIGHTS_VIEW || MayCommand(team, from)) return {};
  if (request.has_share() && (from == roles.leader() || from == roles.survivor())) return {};
  std::string names;
  for (const std::string& name : team.command_from()) names += (names.empty() ? "" : ", ") + name;
  const std::string sender = AgentName(team, from);
  return Fail(ErrorCode::kRefused,
              AgentName(team, self) + " takes no commands relayed by " + sender + ": command_from of its team file (" +
                  names + ") does not name " + sender +
                  "; send the command through an agent in command_from, or directly to " + AgentName(team, self),
              "command_from");
}

void AddRefusedCommands(const std::map<AgentId, double>& refused, proto::AgentStatus& status) {
  for (const auto& [agent, count] : refused) {
    proto::RefusedFrom& entry = *status.add_refused();
    entry.set_agent_id(agent);
    entry.set_cause(proto::REFUSAL_CAUSE_COMMAND);
    entry.set_count(count);
  }
}

}  // namespace moondb
