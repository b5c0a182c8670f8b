#include "model/team_member.h"

namespace moondb {

const proto::AgentConfig* FindAgent(const proto::TeamConfig& team, AgentId id) {
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.id() == id) return &agent;
  }
  return nullptr;
}

const proto::AgentConfig* FindAgent(const proto::TeamConfig& team, const std::string& name) {
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.name() == name) return &agent;
  }
  return nullptr;
}

const std::string& ListenAddressOf(const proto::AgentConfig& agent) {
  return agent.listen().empty() ? agent.address() : agent.listen();
}

bool HasLeft(const proto::TeamConfig& team, AgentId agent) {
  const proto::AgentConfig* config = FindAgent(team, agent);
  return config != nullptr && config->left();
}

AgentId BaseStationOf(const proto::TeamConfig& team) {
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.kind() == proto::AGENT_KIND_BASE_STATION && !agent.left()) return agent.id();
  }
  return 0;
}

}  // namespace moondb
