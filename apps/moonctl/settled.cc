#include "apps/moonctl/settled.h"

#include <algorithm>

#include "apps/common/table.h"
#include "model/agent_name.h"

namespace moondb {

namespace {

std::string WhyNotShared(const proto::TeamConfig& team, const TeamActivity& activity) {
  const auto is_away = [&activity](AgentId agent) { return activity.away.contains(agent); };
  for (const auto& [sender, status] : activity.sharing) {
    const std::string name = AgentName(team, sender);
    for (const proto::ShareSession& session : status.sessions()) {
      if (!session.is_open() || is_away(session.destination())) continue;
      return name + " is sending records to " + AgentName(team, session.destination()) + ", " +
             (session.is_remaining_known() ? FormatCount(session.remaining()) + " left" : "which has not answered yet");
    }
    const auto due = std::ranges::find_if_not(status.due(), is_away);
    if (due != status.due().end()) return name + " has records to send to " + AgentName(team, *due);
    const auto from = std::ranges::find_if_not(status.gathers_from(), is_away);
    if (from != status.gathers_from().end()) {
      return name + " is still fetching the records of " + AgentName(team, *from);
    }
  }
  return "";
}

}  // namespace

std::string WhyNotSettled(const proto::TeamConfig& team, const TeamActivity& activity) {
  const std::string why = WhyNotShared(team, activity);
  if (!why.empty()) return why;
  if (activity.graph.is_solving()) return "the leader is solving the pose graph";
  if (activity.graph.is_due()) return "a solve of the pose graph is due";
  const proto::RegistrationReply& matching = activity.registration;
  if (matching.text().empty() && (!matching.is_done() || matching.is_due())) return "the leader is matching maps";
  return activity.away.empty()
             ? ""
             : AgentName(team, *activity.away.begin()) + " does not answer; the other agents have settled";
}

}  // namespace moondb
