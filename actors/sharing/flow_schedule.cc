#include "actors/sharing/flow_schedule.h"

#include <algorithm>

namespace moondb {

void FlowSchedule::SetDestinations(const std::set<AgentId>& destinations, Time now) {
  if (!is_on()) return;
  std::map<AgentId, Destination> kept;
  for (const AgentId agent : destinations) {
    kept[agent] = destinations_[agent];
    kept[agent].is_due = true;
  }
  destinations_ = std::move(kept);
  full_round_ = now + std::max(period_, kFullRound);
}

void FlowSchedule::Note(const std::function<bool(AgentId)>& may_lack) {
  for (auto& [agent, destination] : destinations_) destination.is_due = destination.is_due || may_lack(agent);
}

std::vector<AgentId> FlowSchedule::TakeDue(Time now, const StateOf& state_of) {
  if (!destinations_.empty() && now >= full_round_) {
    full_round_ = now + std::max(period_, kFullRound);
    Note([](AgentId) { return true; });
  }
  std::vector<AgentId> due;
  for (auto& [agent, destination] : destinations_) {
    if (!destination.is_due) continue;
    const State state = state_of(agent);
    if (!state.is_ready) continue;
    ObserveOutcome(destination, state);
    if (now < destination.next) continue;
    destination.next = now + period_;
    if (state.is_busy) continue;
    destination.is_due = false;
    destination.is_counted = false;
    destination.served = now;
    due.push_back(agent);
  }
  return due;
}

void FlowSchedule::ObserveOutcome(Destination& destination, const State& state) {
  if (destination.is_counted || !state.has_refused) return;
  destination.is_counted = true;
  destination.refusals = *state.has_refused ? destination.refusals + 1 : 0;
  if (destination.refusals == 0) return;
  constexpr int kDoublingsMax = 6;
  const Duration delay =
      std::min(kRefusedDelayMin * (1 << std::min(destination.refusals - 1, kDoublingsMax)), kRefusedDelayMax);
  destination.next = std::max(destination.next, destination.served + delay);
}

std::optional<FlowSchedule::Time> FlowSchedule::deadline(const StateOf& state_of) const {
  if (destinations_.empty()) return std::nullopt;
  Time first = full_round_;
  for (const auto& [agent, destination] : destinations_) {
    if (destination.is_due && state_of(agent).is_ready) first = std::min(first, destination.next);
  }
  return first;
}

std::vector<AgentId> FlowSchedule::FindDue() const {
  std::vector<AgentId> due;
  for (const auto& [agent, destination] : destinations_) {
    if (destination.is_due) due.push_back(agent);
  }
  return due;
}

std::vector<AgentId> FlowSchedule::FindRefusing() const {
  std::vector<AgentId> refusing;
  for (const auto& [agent, destination] : destinations_) {
    if (destination.refusals > 0) refusing.push_back(agent);
  }
  return refusing;
}

}  // namespace moondb
