#include "apps/moonctl/team_letters.h"

#include "model/pyfg.h"

namespace moondb {

std::map<AgentId, AgentId> AgentsByLetter(const proto::TeamConfig& team) {
  constexpr char kBaseLetter = 'L';
  std::map<AgentId, AgentId> agents;
  AgentId place = 0;
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.kind() == proto::AGENT_KIND_BASE_STATION) {
      agents[AgentOfLetter(kBaseLetter)] = agent.id();
      continue;
    }
    if (++place == AgentOfLetter(kBaseLetter)) ++place;
    agents[place] = agent.id();
  }
  return agents;
}

}  // namespace moondb
