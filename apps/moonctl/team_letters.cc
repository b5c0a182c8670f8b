#include "apps/moonctl/team_letters.h"

#include "model/pyfg.h"
#include "model/team_member.h"

namespace moondb {

std::map<AgentId, AgentId> AgentsByLetter(const proto::TeamConfig& team) {
  constexpr char kBaseLetter = 'L';
  std::map<AgentId, AgentId> agents;
  AgentId place = 0;
  for (const proto::AgentConfig& agent : team.agents()) {
    // A base station that has left passes the letter L to its successor.
    const bool is_base = agent.kind() == proto::AGENT_KIND_BASE_STATION && (!agent.left() || BaseStationOf(team) == 0);
    if (is_base && agents.emplace(AgentOfLetter(kBaseLetter), agent.id()).second) continue;
    if (++place == AgentOfLetter(kBaseLetter)) ++place;
    agents[place] = agent.id();
  }
  return agents;
}

}  // namespace moondb
