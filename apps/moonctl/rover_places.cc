#include "apps/moonctl/rover_places.h"

#include <algorithm>

#include "apps/common/table.h"
#include "model/agent_name.h"

namespace moondb {
namespace {

std::string PercentText(double part) { return FormatFixed(100 * part, 0) + " %"; }

std::string FiguresText(const proto::SearchedStart& start) {
  return "evidence " + FormatFixed(start.evidence(), 1) + ", best alternative " + FormatFixed(start.rival(), 1) +
         ", matched " + PercentText(start.matched()) + ", contradicted " + PercentText(start.contradicted());
}

std::string StartText(const proto::TeamConfig& team, const proto::SearchedStart& start) {
  const std::string first = AgentName(team, start.agent_id());
  const std::string second = AgentName(team, start.other_agent_id());
  if (start.is_accepted())
    return "found the pose of " + second + " relative to " + first + ": " + FiguresText(start) + "\n";
  return "did not find the pose of " + second + " relative to " + first + ": " + start.text() + " (" +
         FiguresText(start) + "); " + start.remedy() + ", or give one of them a start\n";
}

}  // namespace

std::string PlacesText(const proto::TeamConfig& team, const proto::RegistrationReply& state) {
  std::string text;
  for (const proto::SearchedStart& start : state.starts()) text += StartText(team, start);
  for (const auto& [rover, what] : FindContradicted(team, state)) text += AgentName(team, rover) + ": " + what + "\n";
  return text;
}

std::string SearchText(const proto::TeamConfig& team, const proto::RegistrationReply& state, AgentId rover) {
  const proto::SearchedStart* nearest = nullptr;
  for (const proto::SearchedStart& start : state.starts()) {
    const bool is_of_rover = start.agent_id() == rover || start.other_agent_id() == rover;
    if (!is_of_rover || start.is_accepted()) continue;
    if (nearest == nullptr || start.evidence() > nearest->evidence()) nearest = &start;
  }
  if (nearest == nullptr) return "";
  const AgentId other = nearest->agent_id() == rover ? nearest->other_agent_id() : nearest->agent_id();
  return "its maps compared with those of " + AgentName(team, other) + ": " + nearest->text() + " (" +
         FiguresText(*nearest) + "); " + nearest->remedy();
}

std::map<AgentId, std::string> FindContradicted(const proto::TeamConfig& team, const proto::RegistrationReply& state) {
  std::map<AgentId, int> against;  // Number of rovers that contradict this one, less those that agree with it.
  for (const proto::MatchedAgents& agents : state.agents()) {
    if (agents.agent_id() == agents.other_agent_id()) continue;
    const bool has_accepted = std::ranges::any_of(
        agents.counts(), [](const proto::RegistrationCount& count) { return count.verdict() == "accepted"; });
    for (const AgentId agent : {agents.agent_id(), agents.other_agent_id()}) {
      against[agent] += agents.places().is_contradicted() ? 1 : has_accepted ? -1 : 0;
    }
  }
  std::map<AgentId, std::string> texts;
  const auto name = [&](const proto::MatchedAgents& agents, AgentId agent, AgentId other) {
    if (against[agent] < against[other]) return;
    std::string& text = texts[agent];
    text += (text.empty() ? "its maps contradict those of " : ", and those of ") + AgentName(team, other) + " (" +
            PercentText(agents.places().contradicted()) + " of the common hazards; " +
            PercentText(agents.places().own_contradicted()) + " within one rover's own maps)";
  };
  for (const proto::MatchedAgents& agents : state.agents()) {
    if (!agents.places().is_contradicted()) continue;
    name(agents, agents.agent_id(), agents.other_agent_id());
    name(agents, agents.other_agent_id(), agents.agent_id());
  }
  for (auto& [agent, text] : texts) {
    text +=
        ": check its start in the team file; correct the start, or remove it, and the leader searches for the place";
  }
  return texts;
}

}  // namespace moondb
