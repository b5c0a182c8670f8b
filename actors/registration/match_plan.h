// MatchPlan: decides which pairs of maps are matched in each pass of a term, and in which window.
//
// A pass covers the candidates (match_candidates.h) at the current poses. A pair is matched at most twice in a term.
// The first time uses the wide window. A later pass uses the narrow window, if the pair was refused or its relative
// pose has moved by more than half the narrow window. Therefore a pass has few pairs unless maps, measurements or
// quarantines are new. Single-threaded.
#pragma once

#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "actors/registration/match_candidates.h"

namespace moondb {

struct PlannedMatch {
  RegisteredMap first;
  RegisteredMap second;
  PlanarOffset expected;  // first_from_second at the current poses.
  MatchWindow window;
};

class MatchPlan {
 public:
  struct Options {
    MatchWindow wide;
    MatchWindow narrow = {0.6, 0.0698};  // 4 degrees.
    CandidateOptions candidates;
    std::size_t pairs_max = 4096;  // Pairs of one pass. The farthest pairs are left out.
  };

  explicit MatchPlan(Options options) : options_(std::move(options)) {}

  // Returns the pairs of a pass, sorted by their maps. Two nodes form at most one pair. `are_joined`: see
  // FindCandidates.
  std::vector<PlannedMatch> StartPass(const std::vector<RegisteredMap>& maps,
                                      const std::function<bool(AgentId, AgentId)>& are_joined) const;
  // Notes the result of a planned match.
  void Note(const PlannedMatch& planned, const MatchResult& result);
  void Clear() { attempts_.clear(); }

 private:
  struct Attempts {
    int count = 0;
    bool is_accepted = false;
    PlanarOffset expected;
  };
  bool IsDue(const Attempts& attempts, const PlanarOffset& expected) const;

  const Options options_;
  std::map<std::pair<RecordKey, RecordKey>, Attempts> attempts_;
};

}  // namespace moondb
