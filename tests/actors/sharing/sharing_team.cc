#include "tests/actors/sharing/sharing_team.h"

#include "model/control_message.h"
#include "proto/control.pb.h"

namespace moondb {

proto::ShareStatus ShareStatusOf(simulation::SimulatedTeam& team, AgentId agent, const char* actor) {
  proto::ControlRequest question;
  question.mutable_share_status();
  (void)team.Post({agent, "status"}, {agent, actor}, MessageOf(question));
  team.RunUntilIdle();
  proto::ShareStatus status;
  for (const proto::Message& message : team.Take({agent, "status"})) {
    if (const auto reply = ControlReplyOf(message)) status = reply->share_status();
  }
  return status;
}

}  // namespace moondb
