// MatchPlan: decides which pairs of maps are matched in each pass of a term, and in which window.
//
// A pass covers the candidates (match_candidates.h) at the current poses. A pair is matched at most twice in a term.
// The first time uses the wide window. A later pass uses the narrow window, if the pair was refused or its relative
// pose has moved by more than half the narrow window. Therefore a pass has few pairs unless maps, measurements or
// quarantines are new.
//
// The pairs of a pass are divided fairly among the pairs of agents; an agent's maps with each other count as one pair
// of agents. This is max-min fairness, as in model/origin_quota.h, the nearest pairs of maps first. The work of a pair
// of agents is limited too: maps like noise take up to 40 times the work of ordinary ones. A pair of agents may
// therefore use pair_work_max for each of its pairs of maps, on average. With n agents, n of n (n + 1) / 2 pairs of
// agents involve one agent, so its part of a full pass is at most 2 / (n + 1). The limits count work and not time, so
// the result depends only on the maps. Single-threaded.
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
    std::size_t pairs_max = 4096;  // Pairs of one pass.
    // Mean work of a pair (MatchResult::work). An ordinary pair takes 4,000 to 8,000, 2 to 3 ms; the most is 164,000. A
    // full pass therefore takes at most 30 s.
    std::size_t pair_work_max = 16'000;
  };

  using AgentPair = std::pair<AgentId, AgentId>;  // The lower id first.
  using Counts = std::map<MatchVerdict, std::size_t>;

  explicit MatchPlan(Options options) : options_(std::move(options)) {}

  // Returns the pairs of a new pass, sorted by their maps. Two nodes form at most one pair. `are_joined`: see
  // FindCandidates.
  std::vector<PlannedMatch> StartPass(const std::vector<RegisteredMap>& maps,
                                      const std::function<bool(AgentId, AgentId)>& are_joined);
  // Returns whether the pass may match this pair. Counts the pair as left out if its agents have used up their work.
  bool HasWorkFor(const PlannedMatch& planned);
  // Adds the result of a planned match.
  void Note(const PlannedMatch& planned, const MatchResult& result);
  // Returns the number of pairs of maps that this pass left out because a pair of agents had no more share.
  std::map<AgentPair, std::size_t> CountLeftOut() const;
  // Returns the last results of all pairs of maps that were matched in this term.
  const std::map<AgentPair, Counts>& CountResults() const { return results_; }
  void Clear();

 private:
  struct Attempts {
    int count = 0;
    MatchVerdict verdict = MatchVerdict::kFewPoints;
    PlanarOffset expected;
  };
  // The part of a pass for one pair of agents.
  struct Share {
    std::size_t work_left = 0;
    std::size_t left_out_count = 0;
  };
  bool IsDue(const Attempts& attempts, const PlanarOffset& expected) const;

  const Options options_;
  std::map<std::pair<RecordKey, RecordKey>, Attempts> attempts_;
  std::map<AgentPair, Share> shares_;  // Shares of the present pass.
  std::map<AgentPair, Counts> results_;
};

}  // namespace moondb
