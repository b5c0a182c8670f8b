#include "actors/pgo/agent_contradictions.h"

#include <algorithm>
#include <set>
#include <utility>

#include "actors/pgo/outlier_tests.h"
#include "model/check.h"

namespace moondb {
namespace {

// A predicted excess from which the solution without the measurements is computed.
constexpr double kSolveExcess = 0.8;
// Share of rejected ranges from which the solution without the measurements is computed from its own initial values.
constexpr double kRejectedShareMax = 0.15;

double SumWithout(const std::map<AgentId, double>& parts, AgentId ignored) {
  double sum = 0;
  for (const auto& [agent, part] : parts) sum += agent == ignored ? 0 : part;
  return sum;
}

// Predicts the solution without the chosen sets.
StagedResult Predict(const SetComparison& comparison, const ChosenSets& chosen, const StagedResult& with,
                     const Linearization& linear) {
  const CostTerms& terms = comparison.terms();
  StagedResult predicted;
  predicted.state = terms.Move(with.state, linear.MoveWithout(chosen.is_chosen));
  predicted.is_inlier = FindInliers(comparison.graph(), terms, terms.TestedResiduals(predicted.state), with.is_inlier,
                                    chosen.is_other, comparison.options());
  return predicted;
}

}  // namespace

double Contradiction::Excess(AgentId ignored) const {
  return std::max(SumWithout(rises, ignored), SumWithout(lost, ignored));
}

std::optional<AgentId> Contradiction::FindAccuser(AgentId accused) const {
  std::optional<AgentId> accuser;
  for (const auto& [agent, rise] : rises) {
    if (agent != accused && (!accuser || Excess(agent) < Excess(*accuser))) accuser = agent;
  }
  return accuser;
}

bool RestsOn(const FactorSet& set, AgentId agent) {
  if (set.source != kRegistrationSource) return set.producer == agent;
  return set.agents.first == agent || set.agents.second == agent;
}

bool IsFixed(const CheckedGraph& graph, AgentId agent) {
  return std::ranges::any_of(graph.nodes,
                             [agent](const CheckedNode& node) { return node.is_fixed && node.key.agent == agent; });
}

Contradiction ContradictionOf(const SetComparison& comparison, const ChosenSets& chosen, const StagedResult& with,
                              const Linearization& linear) {
  if (!chosen.has_accepted) return {};
  const CheckedGraph& graph = comparison.graph();
  const double rise_max = SetComparison::RiseMax(std::max(1.0, linear.EffectiveResiduals(chosen.is_chosen)));
  const double others = static_cast<double>(std::count(
      chosen.is_other.begin(), chosen.is_other.begin() + static_cast<std::ptrdiff_t>(graph.ranges.size()), true));
  const bool has_many_rejected = others - comparison.CountAccepted(with, chosen.is_other) > kRejectedShareMax * others;
  StagedResult without = Predict(comparison, chosen, with, linear);
  const double predicted = comparison.Excess(with, without, chosen.is_other, SetComparison::kRefuseShare, rise_max);
  if (predicted < kSolveExcess && !has_many_rejected) return {};
  without = has_many_rejected
                ? SolveInStages(comparison.terms(), graph, std::nullopt, chosen.is_other, comparison.options())
                : ContinueInStages(comparison.terms(), graph, with, chosen.is_other, comparison.options());
  if (!without.is_accepted) return {};

  Contradiction result;
  const std::vector<bool> is_counted = comparison.ComparedTerms(with, without, chosen.is_other);
  result.rises = comparison.terms().RobustCosts(is_counted, with.state);
  for (const auto& [agent, cost] : comparison.terms().RobustCosts(is_counted, without.state)) {
    result.rises[agent] -= cost;
  }
  for (auto& [agent, rise] : result.rises) rise *= 2 / rise_max;
  const double lost_max =
      SetComparison::LostMax(comparison.CountAccepted(without, chosen.is_other), SetComparison::kRefuseShare);
  for (std::size_t i = 0; i < graph.ranges.size(); ++i) {
    if (!chosen.is_other[i] || with.is_inlier[i] == without.is_inlier[i]) continue;
    result.lost[graph.ProducerOfTested(i)] += (without.is_inlier[i] ? 1 : -1) / lost_max;
  }
  return result;
}

std::map<AgentId, Contradiction> FindContradictions(const SetComparison& comparison, const std::vector<TestedSet>& sets,
                                                    const StagedResult& with) {
  if (!with.is_accepted) return {};
  std::set<AgentId> agents;
  for (const TestedSet& set : sets) {
    if (!set.is_refused && set.set.producer != 0) agents.insert(set.set.producer);
  }
  std::erase_if(agents, [&](AgentId agent) { return IsFixed(comparison.graph(), agent); });
  if (agents.empty()) return {};
  const auto linear = Linearization::Make(comparison.terms().Linearise(with.is_inlier, with.state));
  if (linear == nullptr) return {};
  std::map<AgentId, Contradiction> found;
  for (const AgentId agent : agents) {
    if (comparison.options().stop_requested && comparison.options().stop_requested()) return {};
    const ChosenSets chosen = comparison.Choose(
        sets, [agent](const FactorSet& set) { return RestsOn(set, agent); }, with);
    const Contradiction of_agent = ContradictionOf(comparison, chosen, with, *linear);
    if (of_agent.Excess() >= 1) found[agent] = of_agent;
  }
  return found;
}

AgentId FindLiar(const std::map<AgentId, Contradiction>& found) {
  Check(!found.empty(), "a liar is searched among agents with contradictions");
  AgentId liar = 0;
  std::pair<double, double> least;
  for (const auto& [agent, of_agent] : found) {
    double unexplained = 0;
    for (const auto& [other, of_other] : found) {
      if (other != agent) unexplained += std::max(0.0, of_other.Excess(agent) - 1);
    }
    const std::pair<double, double> rank{unexplained, -of_agent.Excess()};
    if (liar != 0 && rank >= least) continue;
    least = rank;
    liar = agent;
  }
  return liar;
}

}  // namespace moondb
