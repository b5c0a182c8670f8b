#include "apps/moonctl/settled.h"

#include "apps/common/table.h"
#include "model/agent_name.h"

namespace moondb {

std::string WhyNotSettled(const proto::TeamConfig& team, const TeamActivity& activity) {
  for (const auto& [sender, status] : activity.sharing) {
    const std::string name = AgentName(team, sender);
    for (const proto::ShareSession& session : status.sessions()) {
      if (!session.is_open()) continue;
      return name + " sends " + AgentName(team, session.destination()) + " records, " +
             (session.is_remaining_known() ? FormatCount(session.remaining()) + " left" : "it has not answered yet");
    }
    if (!status.due().empty()) return name + " has records for " + AgentName(team, status.due(0));
    if (!status.gathers_from().empty()) {
      return name + " still gathers the records of " + AgentName(team, status.gathers_from(0));
    }
  }
  if (activity.graph.is_solving()) return "the leader solves the pose graph";
  if (activity.graph.is_due()) return "a solve is due";
  const bool is_matching = activity.registration.text().empty() && !activity.registration.is_done();
  return is_matching ? "the leader matches maps" : "";
}

}  // namespace moondb
