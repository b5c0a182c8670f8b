#include "model/agent_name.h"

namespace moondb {

std::string AgentName(const proto::TeamConfig& team, AgentId agent) {
  if (agent == 0) return "nobody";
  for (const proto::AgentConfig& config : team.agents()) {
    if (config.id() == agent) return config.name();
  }
  return "agent " + std::to_string(agent);
}

}  // namespace moondb
