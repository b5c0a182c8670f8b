#include "model/command_from.h"

#include <algorithm>

#include "model/team_member.h"

namespace moondb {

bool MayCommand(const proto::TeamConfig& team, AgentId agent) {
  const auto& agents = team.agents();
  const proto::AgentConfig* found = FindAgent(team, agent);
  if (found == nullptr || found->left()) return false;
  if (team.command_from().empty()) {
    const bool has_base = std::any_of(agents.begin(), agents.end(), [](const proto::AgentConfig& config) {
      return config.kind() == proto::AGENT_KIND_BASE_STATION;
    });
    return !has_base || found->kind() == proto::AGENT_KIND_BASE_STATION;
  }
  return std::any_of(team.command_from().begin(), team.command_from().end(),
                     [found](const std::string& name) { return name == kAllMayCommand || name == found->name(); });
}

}  // namespace moondb
