#include "actors/pgo/set_comparison.h"

#include <algorithm>
#include <cmath>

namespace moondb {
namespace {

constexpr double kRangesLostMin = 3;

}  // namespace

std::vector<bool> SetComparison::Allowed(const std::vector<TestedSet>& sets) const {
  std::vector<bool> is_allowed = is_allowed_;
  for (const TestedSet& set : sets) {
    if (!set.is_refused) continue;
    for (const std::size_t factor : set.set.factors) is_allowed[factor] = false;
  }
  return is_allowed;
}

ChosenSets SetComparison::Choose(const std::vector<TestedSet>& sets,
                                 const std::function<bool(const FactorSet&)>& is_chosen,
                                 const StagedResult& with) const {
  ChosenSets chosen;
  chosen.is_chosen.assign(with.is_inlier.size(), false);
  chosen.is_other = Allowed(sets);
  for (const TestedSet& set : sets) {
    if (set.is_refused || !is_chosen(set.set)) continue;
    chosen.sets.push_back(&set);
    for (const std::size_t factor : set.set.factors) {
      chosen.is_chosen[factor] = true;
      chosen.is_other[factor] = false;
      chosen.has_accepted = chosen.has_accepted || with.is_inlier[factor];
    }
  }
  return chosen;
}

double SetComparison::Excess(const StagedResult& with, const StagedResult& without, const std::vector<bool>& is_other,
                             double share, double rise_max) const {
  const double accepted = CountAccepted(without, is_other);
  return std::max((accepted - CountAccepted(with, is_other)) / LostMax(accepted, share),
                  ChiSquareRise(with, without, is_other) / rise_max);
}

double SetComparison::ChiSquareRise(const StagedResult& with, const StagedResult& without,
                                    const std::vector<bool>& is_other) const {
  const std::vector<bool> is_counted = ComparedTerms(with, without, is_other);
  return 2 * (terms_.RobustCost(is_counted, with.state) - terms_.RobustCost(is_counted, without.state));
}

std::vector<bool> SetComparison::ComparedTerms(const StagedResult& with, const StagedResult& without,
                                               std::vector<bool> is_other) const {
  for (std::size_t i = graph_.first_closure(); i < is_other.size(); ++i) {
    is_other[i] = is_other[i] && with.is_inlier[i] && without.is_inlier[i];
  }
  return is_other;
}

double SetComparison::CountAccepted(const StagedResult& staged, const std::vector<bool>& is_other) const {
  double count = 0;
  for (std::size_t i = 0; i < graph_.ranges.size(); ++i) count += staged.is_inlier[i] && is_other[i];
  return count;
}

double SetComparison::LostMax(double accepted, double share) {
  return std::max(kRangesLostMin, share * accepted + 1e-9);  // The share itself is allowed.
}

double SetComparison::RiseMax(double expected) { return expected + kRefuseSigmas * std::sqrt(2 * expected); }

}  // namespace moondb
