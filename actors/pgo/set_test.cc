#include "actors/pgo/set_test.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace moondb {

namespace {

constexpr std::size_t kSetsMax = 16;
constexpr std::size_t kSetSizeMin = 3;  // Fewer rejected factors are not reported as a refused set.
constexpr double kRangesLostMin = 3;
constexpr double kRefuseShare = 0.03;
constexpr double kReturnShare = 0.02;
constexpr double kRefuseSigmas = 3;

struct TestedSet {
  FactorSet set;
  bool was_refused = false;  // True if the last solution refused the set.
  bool is_refused = false;
};

// Returns true if the last solution rejected every factor of the set on which it has a verdict.
bool WasRefused(const CheckedGraph& graph, const FactorSet& set, const LastSolution& last) {
  bool has_rejected = false;
  for (const std::size_t factor : set.factors) {
    const FactorKey key = graph.KeyOfTested(factor);
    if (last.accepted.contains(key)) return false;
    has_rejected = has_rejected || last.rejected.contains(key);
  }
  return has_rejected;
}

class SetTester {
 public:
  SetTester(const CostTerms& terms, const CheckedGraph& graph, const std::optional<FirstVerdicts>& first,
            const std::vector<bool>& is_allowed, const LastSolution& last, const SolverOptions& options)
      : terms_(terms), graph_(graph), first_(first), is_allowed_(is_allowed), options_(options) {
    std::vector<FactorSet> sets = FindFactorSets(graph);
    for (FactorSet& set : sets) {
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
    while (TestedSet* const worst = FindWorst(staged)) {
      worst->is_refused = true;
      staged = Solve(std::nullopt);
    }
    if (staged.is_accepted && IsStopped()) {
      staged.is_accepted = false;
      staged.text = "stopped before all sets of loop closures and priors were tested";
    }
    return Finish(std::move(staged));
  }

 private:
  bool IsStopped() const { return options_.stop_requested && options_.stop_requested(); }

  // Solves without the refused sets.
  StagedResult Solve(const std::optional<FirstVerdicts>& first) const {
    return SolveInStages(terms_, graph_, first, AllowedWithout(nullptr), options_);
  }

  // Returns the flags of the allowed factors that belong neither to a refused set nor to `left_out`.
  std::vector<bool> AllowedWithout(const TestedSet* left_out) const {
    std::vector<bool> is_allowed = is_allowed_;
    for (const TestedSet& set : sets_) {
      if (!set.is_refused && &set != left_out) continue;
      for (const std::size_t factor : set.set.factors) is_allowed[factor] = false;
    }
    return is_allowed;
  }

  double CountAcceptedRanges(const StagedResult& staged) const {
    return static_cast<double>(std::count(
        staged.is_inlier.begin(), staged.is_inlier.begin() + static_cast<std::ptrdiff_t>(graph_.ranges.size()), true));
  }

  // Returns the excess of the set's cost over its limits, as a ratio: 1 or more if the set is to be refused. `with`:
  // the solution that includes the set.
  double Excess(const TestedSet& set, const StagedResult& with) const {
    double residual_count = 0;
    std::size_t accepted_factors = 0;
    for (const std::size_t factor : set.set.factors) {
      if (!with.is_inlier[factor]) continue;
      residual_count += ResidualsOf(factor);
      ++accepted_factors;
    }
    if (accepted_factors == 0) return 0;
    const bool is_doubtful = set.was_refused || 2 * accepted_factors < set.set.factors.size();
    const StagedResult without = ContinueInStages(terms_, graph_, with, AllowedWithout(&set), options_);
    if (!without.is_accepted) return 0;
    const double accepted = CountAcceptedRanges(without);
    const double share = is_doubtful ? kReturnShare : kRefuseShare;
    const double lost_max = std::max(kRangesLostMin, share * accepted + 1e-9);  // The share itself is allowed.
    const double rise_max =
        is_doubtful ? residual_count : residual_count + kRefuseSigmas * std::sqrt(2 * residual_count);
    return std::max((accepted - CountAcceptedRanges(with)) / lost_max, ChiSquareRise(with, without) / rise_max);
  }

  // Returns how much larger 2 F is at `with` than at `without`, over the terms outside of the set: all ranges, with the
  // Cauchy loss, and the other factors that both solutions accept.
  double ChiSquareRise(const StagedResult& with, const StagedResult& without) const {
    std::vector<bool> is_counted(with.is_inlier.size(), true);
    for (std::size_t i = graph_.first_closure(); i < is_counted.size(); ++i) {
      is_counted[i] = with.is_inlier[i] && without.is_inlier[i];
    }
    return 2 * (terms_.RobustCost(is_counted, with.state) - terms_.RobustCost(is_counted, without.state));
  }

  double ResidualsOf(std::size_t factor) const {
    if (factor < graph_.first_prior()) return 6;
    return static_cast<double>(graph_.priors[factor - graph_.first_prior()].prior->extent);
  }

  // Returns the set whose cost exceeds its limit most; null if there is none. `staged` is the solution with all sets
  // that are not refused.
  TestedSet* FindWorst(const StagedResult& staged) {
    if (!staged.is_accepted) return nullptr;
    TestedSet* worst = nullptr;
    double worst_excess = 1;
    for (std::size_t i = 0; i < std::min(sets_.size(), kSetsMax); ++i) {
      if (sets_[i].is_refused) continue;
      if (IsStopped()) return nullptr;
      const double excess = Excess(sets_[i], staged);
      if (excess < worst_excess || (worst != nullptr && excess == worst_excess)) continue;
      worst_excess = excess;
      worst = &sets_[i];
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

  const CostTerms& terms_;
  const CheckedGraph& graph_;
  const std::optional<FirstVerdicts>& first_;
  const std::vector<bool>& is_allowed_;
  const SolverOptions& options_;
  std::vector<TestedSet> sets_;  // Largest first.
};

}  // namespace

std::vector<FactorSet> FindFactorSets(const CheckedGraph& graph) {
  std::map<std::tuple<FactorKind, std::pair<AgentId, AgentId>, std::string>, FactorSet> sets;
  for (std::size_t factor = graph.first_closure(); factor < graph.tested_count(); ++factor) {
    FactorKey key = graph.KeyOfTested(factor);
    const std::pair<AgentId, AgentId> agents = std::minmax(key.from.agent, key.to.agent);
    FactorSet& set = sets[{key.kind, agents, key.source}];
    set.kind = key.kind;
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
