// StartSearch: finds where a rover with an unknown start began, by matching its maps with those of placed rovers over
// all rotations.
//
// The search matches up to 16 maps of the rover with up to 128 maps of placed rovers, each pair once per term. A single
// match may be wrong, because rooms look alike. Therefore the solver gets the matches of a rover only if these hold:
// - At least two of them share no map and give the same start, within 5 degrees and 0.3 m plus 5 % of the distance
//   between their maps of the rover.
// - At most a third as many contradict them.
// The solver then places the rover by these loop closures.
//
// Limits: about 60 ms of CPU time per pair. If no rover is placed, there is nothing to match with. Single-threaded.
#pragma once

#include <map>
#include <set>
#include <utility>
#include <vector>

#include "actors/registration/match_plan.h"

namespace moondb {

class StartSearch {
 public:
  using Accepted = std::pair<PlannedMatch, MatchResult>;

  static constexpr std::size_t kRoverMapsMax = 16;
  static constexpr std::size_t kOtherMapsMax = 128;

  // Returns the pairs to match next: `second` is a map of a rover that is not placed. `placed`: agents whose poses are
  // in the frame `map`.
  std::vector<PlannedMatch> Plan(const std::vector<RegisteredMap>& maps, const std::set<AgentId>& placed) const;

  // Notes the result of a planned match.
  void Note(const PlannedMatch& planned, const MatchResult& result);

  // Returns the matches of the rover that agree; empty if too few agree or too many contradict them.
  std::vector<Accepted> FindAgreeing(AgentId rover) const;

  void Clear() { *this = StartSearch(); }

 private:
  std::set<std::pair<RecordKey, RecordKey>> tried_;
  std::map<AgentId, std::vector<Accepted>> accepted_;
};

}  // namespace moondb
