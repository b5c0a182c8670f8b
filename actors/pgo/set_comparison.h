// SetComparison: compares a solution with the solution without some sets of measurements (set_test.h).
//
// The comparison is over the other terms: those that belong to none of these sets and to no refused set. Ranges count
// with the Cauchy loss, so that wrong ranges, which both solutions reject, cancel.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "actors/pgo/cost_terms.h"
#include "actors/pgo/staged_solve.h"

namespace moondb {

struct TestedSet {
  FactorSet set;
  bool was_refused = false;  // True if the last solution refused the set.
  bool is_refused = false;
};

// Some of the sets that are not refused, with one flag per tested factor.
struct ChosenSets {
  std::vector<const TestedSet*> sets;
  std::vector<bool> is_chosen;
  std::vector<bool> is_other;  // Allowed factors that belong neither to a chosen nor to a refused set.
  bool has_accepted = false;   // True if `with` accepts a chosen factor.
};

class SetComparison {
 public:
  static constexpr double kRefuseShare = 0.03;
  static constexpr double kRefuseSigmas = 3;

  // All arguments must outlive this object. `is_allowed`: factors that the solve may use, refused sets included.
  SetComparison(const CostTerms& terms, const CheckedGraph& graph, const std::vector<bool>& is_allowed,
                const SolverOptions& options)
      : terms_(terms), graph_(graph), is_allowed_(is_allowed), options_(options) {}

  const CostTerms& terms() const { return terms_; }
  const CheckedGraph& graph() const { return graph_; }
  const SolverOptions& options() const { return options_; }

  // Returns the flags of the allowed factors that belong to no refused set.
  std::vector<bool> Allowed(const std::vector<TestedSet>& sets) const;
  ChosenSets Choose(const std::vector<TestedSet>& sets, const std::function<bool(const FactorSet&)>& is_chosen,
                    const StagedResult& with) const;

  // Returns the larger of two ratios. The first is the number of ranges lost because of the sets, divided by LostMax.
  // The second is the rise of the other terms' chi-square, divided by `rise_max`. The sets are to be refused at 1.
  double Excess(const StagedResult& with, const StagedResult& without, const std::vector<bool>& is_other, double share,
                double rise_max) const;
  // Returns how much larger 2 F is at `with` than at `without`, over the terms of ComparedTerms.
  double ChiSquareRise(const StagedResult& with, const StagedResult& without, const std::vector<bool>& is_other) const;
  // Returns the factors that are compared: of those in `is_other`, the ranges, and the other factors that both
  // solutions accept.
  std::vector<bool> ComparedTerms(const StagedResult& with, const StagedResult& without,
                                  std::vector<bool> is_other) const;
  // Returns the number of ranges in `is_other` that the solution accepts.
  double CountAccepted(const StagedResult& staged, const std::vector<bool>& is_other) const;
  // Returns the number of lost ranges at which a set is refused, if `accepted` ranges are accepted without it.
  static double LostMax(double accepted, double share);
  // Returns the rise of the chi-square at which a set is refused. `expected`: the rise that correct measurements cause
  // on average.
  static double RiseMax(double expected);

 private:
  const CostTerms& terms_;
  const CheckedGraph& graph_;
  const std::vector<bool>& is_allowed_;
  const SolverOptions& options_;
};

}  // namespace moondb
