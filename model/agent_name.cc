#include "model/agent_name.h"

#include "model/team_member.h"

namespace moondb {

std::string AgentName(const proto::TeamConfig& team, AgentId agent) {
  if (agent == 0) return "nobody";
  const proto::AgentConfig* config = FindAgent(team, agent);
  return config == nullptr ? "agent " + std::to_string(agent) : config->name();
}

}  // namespace moondb
