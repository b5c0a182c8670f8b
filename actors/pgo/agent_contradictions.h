// FindContradictions: finds the agents whose measurements, taken together, contradict those of the others.
//
// A rover that lies can split its measurements into many sets that agree with each other, so that no single set makes
// a difference. All measurements that rest on the word of one agent are therefore left out at once: those that it
// inserted, and the matches of its maps.
//
// They contradict the others if they raise the chi-square of the other terms by more than n + 3 sqrt(2 n). They also do
// if more than 3 % of the other ranges, and at least 3, are accepted only without them. n is the effective number of
// residuals (linearization.h). Correct measurements raise the chi-square by n on average, and by 0.4 n to 1.5 n in two
// recorded missions and a public graph with 7,789 real ranges.
//
// The linearised problem predicts the solution without the measurements. The graph is solved again only if the
// prediction comes near the limit, or if many ranges are rejected, which a prediction cannot undo.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "actors/pgo/linearization.h"
#include "actors/pgo/set_comparison.h"

namespace moondb {

// How much the measurements of one agent contradict the terms of each agent: its odometry, start and gravity, and the
// measurements that it inserted. The values are ratios to the limits.
struct Contradiction {
  std::map<AgentId, double> rises;  // Rise of the chi-square.
  std::map<AgentId, double> lost;   // Lost ranges.

  // Returns the excess without what the terms of `ignored` say. 1 or more: the measurements are wrong.
  double Excess(AgentId ignored = 0) const;
  // Returns the agent other than `accused` whose terms contradict most; nullopt if there is none.
  std::optional<AgentId> FindAccuser(AgentId accused) const;
};

// Returns true if the measurements of the set rest on the word of `agent`: it inserted them, or they are matches of its
// maps.
bool RestsOn(const FactorSet& set, AgentId agent);

// Returns true if all nodes of the agent are fixed: it is a base station, and trusted.
bool IsFixed(const CheckedGraph& graph, AgentId agent);

// Returns the agents with an excess of 1 or more at the solution `with`. Agents whose measurements are of unknown
// origin (producer 0) are not tested. Ends early, with no agent, if the solve is to stop.
std::map<AgentId, Contradiction> FindContradictions(const SetComparison& comparison, const std::vector<TestedSet>& sets,
                                                    const StagedResult& with);

// Returns how much the chosen sets contradict the others; nothing if the prediction stays below the limit.
Contradiction ContradictionOf(const SetComparison& comparison, const ChosenSets& chosen, const StagedResult& with,
                              const Linearization& linear);

// Returns the agent that explains the contradictions: without what its terms say, the fewest others seem wrong. The
// word of one agent must not suffice to refuse another. Requires: `found` is not empty.
AgentId FindLiar(const std::map<AgentId, Contradiction>& found);

}  // namespace moondb
