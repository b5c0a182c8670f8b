#include "actors/pgo/set_test.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "actors/pgo/agent_contradictions.h"
#include "actors/pgo/set_comparison.h"

namespace moondb {

namespace {

constexpr std::size_t kSetsMax = 16;
constexpr std::size_t kSetSizeMin = 3;  // Fewer rejected factors are not reported as a refused set.
constexpr double kReturnShare = 0.02;
constexpr std::size_t kPartsMax = 8;     // Parts of an agent's measurements that are refused by themselves.
constexpr std::size_t kIsolatedMax = 8;  // In larger teams, no agent is isolated.
constexpr double kRejectedMargin = 3;
constexpr int kRoundsMax = 64;  // Refusals of measurements of agents in one solve.
// An agent whose excess falls below this without the terms of one other agent is accused by that one alone.
constexpr double kWithoutAccuserMin = 0.5;

// Returns true if the last solution rejected every factor of the set on which it has a verdict.
bool WasRefused(const CheckedGraph& graph, const FactorSet& set, const LastSolution& last) {
  bool has_rejected = false;
  for (const std::size_t factor : set.factors) {
    const FactorKey key = graph.KeyOfTested(factor);
    const bool is_known_range =
        key.kind == FactorKind::kRange && last.poses.contains(key.from) && last.poses.contains(key.to);
    const bool was_rejected = last.rejected.contains(key);
    if (last.accepted.contains(key) || (is_known_range && !was_rejected)) return false;
    has_rejected = has_rejected || was_rejected;
  }
  return has_rejected;
}

// Returns true if the set ties `agent` to others or to the map.
bool Ties(const FactorSet& set, AgentId agent) { return set.agents.first == agent || set.agents.second == agent; }

bool IsBetween(const FactorSet& set, AgentId a, AgentId b) {
  return set.agents == std::pair<AgentId, AgentId>(std::minmax(a, b));
}

class SetTester {
 public:
  SetTester(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
            const std::vector<bool>& is_allowed, const LastSolution& last, const SolverOptions& options)
      : comparison_(terms, graph, is_allowed, options),
        terms_(terms),
        graph_(graph),
        first_(first),
        is_allowed_(is_allowed),
        options_(options) {
    for (FactorSet& set : FindFactorSets(graph)) {
      const bool was_refused = WasRefused(graph, set, last);
      sets_.push_back({std::move(set), was_refused, false});
    }
    std::stable_sort(sets_.begin(), sets_.end(), [](const TestedSet& a, const TestedSet& b) {
      return a.set.factors.size() > b.set.factors.size();
    });
  }

  SetTested Run() {
    if (options_.window_nodes > 0) {
      for (TestedSet& set : sets_) set.is_refused = set.was_refused;
      return Finish(Solve(first_));
    }
    StagedResult staged = Solve(first_);
    for (int round = 0; round < kRoundsMax && RefuseOfAgents(staged); ++round) staged = Solve(std::nullopt);
    while (TestedSet* const worst = FindWorst(staged)) {
      worst->is_refused = true;
      staged = Solve(std::nullopt);
    }
    if (staged.is_accepted && IsStopped()) {
      staged.is_accepted = false;
      staged.text = "stopped before all sets of measurements were tested";
    }
    return Finish(std::move(staged));
  }

 private:
  bool IsStopped() const { return options_.stop_requested && options_.stop_requested(); }

  // Solves without the refused sets.
  StagedResult Solve(const std::optional<FirstVerdicts>& first) const {
    return SolveInStages(terms_, graph_, first, comparison_.Allowed(sets_), options_);
  }

  // Refuses measurements of the agent that contradicts the others most. Returns false if no agent does.
  bool RefuseOfAgents(const StagedResult& staged) {
    const std::map<AgentId, Contradiction> found = FindContradictions(comparison_, sets_, staged);
    if (found.empty()) return false;
    const AgentId liar = FindLiar(found);
    const std::optional<AgentId> accuser = found.at(liar).FindAccuser(liar);
    const bool has_one_accuser = accuser && found.at(liar).Excess(*accuser) < kWithoutAccuserMin;
    if (has_one_accuser && !IsFixed(graph_, *accuser)) {
      RefuseBetween(liar, *accuser);
    } else {
      RefuseSetsOf(liar, staged);
    }
    return true;
  }

  // Refuses the agent's measurements of one source or of one kind if the rest of them then contradicts nobody;
  // otherwise all of them.
  void RefuseSetsOf(AgentId agent, const StagedResult& staged) {
    using Part = std::pair<FactorKind, std::optional<std::string>>;
    std::set<Part> parts;
    for (const TestedSet& set : sets_) {
      if (set.is_refused || !RestsOn(set.set, agent)) continue;
      parts.insert({set.set.kind, std::nullopt});
      if (set.set.kind != FactorKind::kRange && parts.size() < kPartsMax) parts.insert({set.set.kind, set.set.source});
    }
    const auto is_of = [](const FactorSet& set, const Part& part) {
      return set.kind == part.first && (!part.second || set.source == *part.second);
    };
    std::optional<Part> refused;
    double least = 1;
    for (const Part& part : parts) {
      const double excess = ExcessWithoutPart(
          agent, [&](const FactorSet& set) { return is_of(set, part); }, staged);
      if (excess >= least) continue;
      least = excess;
      refused = part;
    }
    (void)Refuse([&](const FactorSet& set) { return RestsOn(set, agent) && (!refused || is_of(set, *refused)); });
  }

  // Returns the excess of the agent's measurements that are left if those for which `is_part` is true are refused.
  double ExcessWithoutPart(AgentId agent, const std::function<bool(const FactorSet&)>& is_part,
                           const StagedResult& staged) {
    const ChosenSets part = comparison_.Choose(
        sets_, [&](const FactorSet& set) { return RestsOn(set, agent) && is_part(set); }, staged);
    if (!part.has_accepted) return std::numeric_limits<double>::infinity();
    const std::vector<TestedSet> before = sets_;
    (void)Refuse([&](const FactorSet& set) { return RestsOn(set, agent) && is_part(set); });
    const StagedResult without = Solve(std::nullopt);
    double excess = std::numeric_limits<double>::infinity();
    if (without.is_accepted) {
      const auto linear = Linearization::Make(terms_.Linearise(without.is_inlier, without.state));
      const ChosenSets rest = comparison_.Choose(
          sets_, [agent](const FactorSet& set) { return RestsOn(set, agent); }, without);
      if (linear != nullptr) excess = ContradictionOf(comparison_, rest, without, *linear).Excess();
    }
    sets_ = before;
    return excess;
  }

  // Only one of the two agents contradicts the other, and either may be wrong. Refuses the measurements between them,
  // or all measurements that tie one agent to others, because its odometry or its own place is wrong: whatever ends the
  // contradictions and leaves the fewest factors rejected.
  void RefuseBetween(AgentId a, AgentId b) {
    const std::vector<TestedSet> before = sets_;
    const auto is_between = [a, b](const FactorSet& set) { return IsBetween(set, a, b); };
    std::vector<TestedSet> best;
    double fewest = std::numeric_limits<double>::infinity();
    const auto try_without = [&](const std::function<bool(const FactorSet&)>& is_refused) {
      sets_ = before;
      if (IsStopped() || !Refuse(is_refused)) return;
      const StagedResult without = Solve(std::nullopt);
      if (!without.is_accepted || !FindContradictions(comparison_, sets_, without).empty()) return;
      const double rejected = CountRejected(without);
      if (rejected >= fewest) return;
      // An agent is isolated only if this explains clearly more than a quarrel of two agents.
      fewest = best.empty() ? std::max(0.0, rejected - kRejectedMargin) : rejected;
      best = sets_;
    };
    try_without(is_between);
    std::set<AgentId> agents;
    for (const TestedSet& set : before) agents.insert({set.set.agents.first, set.set.agents.second});
    std::erase_if(agents, [this](AgentId agent) { return IsFixed(graph_, agent); });
    for (const AgentId agent : agents) {
      if (agents.size() > kIsolatedMax) break;
      try_without([agent](const FactorSet& set) { return Ties(set, agent); });
    }
    sets_ = best.empty() ? before : best;
    if (best.empty() && !Refuse(is_between)) (void)Refuse([a](const FactorSet& set) { return RestsOn(set, a); });
  }

  // Returns the number of rejected factors that belong to no refused set.
  double CountRejected(const StagedResult& staged) const {
    const std::vector<bool> is_allowed = comparison_.Allowed(sets_);
    double count = 0;
    for (std::size_t i = 0; i < is_allowed.size(); ++i) count += is_allowed[i] && !staged.is_inlier[i];
    return count;
  }

  // Refuses the sets for which `is_refused` is true. Returns false if all of them were refused before.
  bool Refuse(const std::function<bool(const FactorSet&)>& is_refused) {
    bool has_refused = false;
    for (TestedSet& set : sets_) {
      if (set.is_refused || !is_refused(set.set)) continue;
      set.is_refused = has_refused = true;
    }
    return has_refused;
  }

  // Returns the excess of the set's cost over its limits, as a ratio: 1 or more if the set is to be refused. `with`:
  // the solution that includes the set.
  double Excess(const TestedSet& set, const StagedResult& with) const {
    const ChosenSets chosen = comparison_.Choose(
        sets_, [&set](const FactorSet& other) { return &other == &set.set; }, with);
    double residual_count = 0;
    std::size_t accepted_factors = 0;
    for (const std::size_t factor : set.set.factors) {
      if (!with.is_inlier[factor]) continue;
      residual_count += ResidualsOf(factor);
      ++accepted_factors;
    }
    if (accepted_factors == 0) return 0;
    const bool is_doubtful = set.was_refused || 2 * accepted_factors < set.set.factors.size();
    const StagedResult without = ContinueInStages(terms_, graph_, with, chosen.is_other, options_);
    if (!without.is_accepted) return 0;
    return comparison_.Excess(with, without, chosen.is_other, is_doubtful ? kReturnShare : SetComparison::kRefuseShare,
                              is_doubtful ? residual_count : SetComparison::RiseMax(residual_count));
  }

  double ResidualsOf(std::size_t factor) const {
    if (factor < graph_.first_prior()) return 6;
    return static_cast<double>(graph_.priors[factor - graph_.first_prior()].prior->extent);
  }

  // Returns the set of loop closures or priors whose cost exceeds its limit most; null if there is none. Tests the
  // kSetsMax largest. `staged` is the solution with all sets that are not refused.
  TestedSet* FindWorst(const StagedResult& staged) {
    if (!staged.is_accepted) return nullptr;
    TestedSet* worst = nullptr;
    double worst_excess = 1;
    std::size_t count = 0;
    for (TestedSet& set : sets_) {
      if (set.set.kind == FactorKind::kRange) continue;
      if (++count > kSetsMax) break;
      if (set.is_refused) continue;
      if (IsStopped()) return nullptr;
      const double excess = Excess(set, staged);
      if (excess < worst_excess || (worst != nullptr && excess == worst_excess)) continue;
      worst_excess = excess;
      worst = &set;
    }
    return worst;
  }

  SetTested Finish(StagedResult staged) {
    SetTested result;
    result.staged = std::move(staged);
    for (TestedSet& set : sets_) {
      // Factors that were not allowed contradict nothing.
      const bool stays_refused = set.was_refused && set.set.factors.size() >= kSetSizeMin &&
                                 std::ranges::all_of(set.set.factors, [&](std::size_t factor) {
                                   return is_allowed_[factor] && !result.staged.is_inlier[factor];
                                 });
      if (set.is_refused || stays_refused) result.refused.push_back(std::move(set.set));
    }
    return result;
  }

  const SetComparison comparison_;
  const CostTerms& terms_;
  const CheckedGraph& graph_;
  const std::optional<FirstVerdicts>& first_;
  const std::vector<bool>& is_allowed_;
  const SolverOptions& options_;
  std::vector<TestedSet> sets_;  // Largest first.
};

}  // namespace

std::vector<FactorSet> FindFactorSets(const CheckedGraph& graph) {
  std::map<std::tuple<AgentId, FactorKind, std::pair<AgentId, AgentId>, std::string>, FactorSet> sets;
  for (std::size_t factor = 0; factor < graph.tested_count(); ++factor) {
    FactorKey key = graph.KeyOfTested(factor);
    const std::pair<AgentId, AgentId> agents = std::minmax(key.from.agent, key.to.agent);
    const AgentId producer = graph.ProducerOfTested(factor);
    FactorSet& set = sets[{producer, key.kind, agents, key.source}];
    set.kind = key.kind;
    set.producer = producer;
    set.agents = agents;
    set.source = std::move(key.source);
    set.factors.push_back(factor);
  }
  std::vector<FactorSet> result;
  for (auto& [name, set] : sets) result.push_back(std::move(set));
  return result;
}

SetTested SolveWithSetTest(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
                           const std::vector<bool>& is_allowed, const LastSolution& last,
                           const SolverOptions& options) {
  return SetTester(terms, graph, first, is_allowed, last, options).Run();
}

}  // namespace moondb
