#include "apps/moonctl/team_letters.h"

#include "model/agent_name.h"
#include "model/pyfg.h"
#include "model/team_member.h"

namespace moondb {
namespace {

constexpr char kBaseLetter = 'L';

}  // namespace

std::map<AgentId, AgentId> AgentsByLetter(const proto::TeamConfig& team) {
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

std::map<AgentId, AgentId> AgentsByLetterOfAnyCase(const proto::TeamConfig& team) {
  const AgentId small_offset = AgentOfLetter('a') - AgentOfLetter('A');
  const std::map<AgentId, AgentId> agents = AgentsByLetter(team);
  std::map<AgentId, AgentId> all = agents;
  if (agents.empty() || agents.rbegin()->first > small_offset) return all;
  for (const auto& [letter, agent] : agents) {
    // Programs name landmarks l0, l1 and so on. They are not the base station.
    if (LetterOfAgent(letter) != kBaseLetter) all[letter + small_offset] = agent;
  }
  return all;
}

std::string LettersText(const proto::TeamConfig& team) {
  constexpr std::size_t kShownMax = 12;
  const std::map<AgentId, AgentId> agents = AgentsByLetter(team);
  std::string text;
  std::size_t shown_count = 0;
  for (const auto& [letter, agent] : agents) {
    if (shown_count++ == kShownMax) return text + ", ...";
    text += (text.empty() ? "" : ", ") + std::string(1, LetterOfAgent(letter)) + " is " + AgentName(team, agent);
  }
  return text;
}

}  // namespace moondb
