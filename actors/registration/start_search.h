// StartSearch: finds where rovers that started anywhere lie, by matching their submaps.
//
// The search takes pairs of rovers whose frames nothing ties together. For each pair it matches all submaps of one with
// all of the other (submap_matching.h), finds sets of places that agree with both odometries (submap_sets.h), and
// judges the best one (start_verdict.h). If it is accepted, single maps near the places of the set are matched in a
// small window (map_matching.h). Their matches are the result; the solver then places the rover by these loop closures.
//
// Work is done in steps of at most about 80 ms. Later passes of the term match only submaps that are new, and a submap
// changes only if its maps do. Deterministic: the same maps give the same verdicts.
//
// Limits: kPairsMax pairs of submaps in a pass, in the order of the agents, the newest submaps first; the rest follows
// in the next pass. About 30 ms for a pair of submaps, ten times as long on open ground. Memory: 64 submaps of 1.5 MB,
// and up to 1,200 places of 150 bytes for each pair of rovers. Single-threaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "actors/registration/field_cache.h"
#include "actors/registration/known_maps.h"
#include "actors/registration/match_plan.h"
#include "actors/registration/searched_rover.h"
#include "actors/registration/start_verdict.h"
#include "actors/registration/submap_matching.h"
#include "actors/registration/submap_sets.h"

namespace moondb {

class StartSearch {
 public:
  using Accepted = std::pair<PlannedMatch, MatchResult>;
  using AgentPair = MatchPlan::AgentPair;

  static constexpr std::size_t kPairsMax = 4096;
  static constexpr std::size_t kSubmapsMax = 64;   // Kept in memory.
  static constexpr std::size_t kMapPairsMax = 60;  // Pairs of single maps that are matched for a set.
  static constexpr std::size_t kMapPairsMin = 3;   // Number of them that must pass.

  // Begins a pass over the pairs of `rovers` that are `wanted`. Forgets what it knows about other pairs.
  void Begin(std::map<AgentId, SearchedRover> rovers, const std::vector<AgentPair>& wanted);
  // Does one step. Returns the matches to store, if this step completed them. Requires: left_count() is not 0.
  std::vector<Accepted> Step(const KnownMaps& maps, FieldCache& fields);
  // Number of pairs of submaps that are still to be matched, and at least one for each pair of rovers that is not done.
  std::size_t left_count() const;

  // The last verdict on each pair of rovers in this term.
  const std::map<AgentPair, JudgedStart>& judged() const { return judged_; }

  void Clear() { *this = StartSearch(); }

 private:
  // The search for one pair of rovers.
  struct Search {
    AgentPair agents;
    std::vector<std::pair<std::size_t, std::size_t>> windows;  // To be matched, the next one last.
    std::optional<SubmapSets> sets;
    bool has_sets = false;  // All sets are found.
    std::vector<SetFit> fits;
    std::size_t fit_row = 0;  // Next submap of the first rover to compare, in the last of `fits`.
    bool is_judged = false;
    std::vector<PlannedMatch> planned;  // Single maps, the next one last.
    std::vector<Accepted> passed;
  };
  using WindowPair = std::pair<std::uint64_t, std::uint64_t>;  // Their hashes.

  const SearchedRover& First(const Search& search) const { return rovers_.at(search.agents.first); }
  const SearchedRover& Second(const Search& search) const { return rovers_.at(search.agents.second); }
  std::vector<std::uint64_t> WindowsOf(const AgentPair& agents) const;
  std::shared_ptr<const SubmapTemplate> TemplateOf(const SearchedRover& rover, std::size_t window,
                                                   const KnownMaps& maps);
  void MatchNext(Search& search, const KnownMaps& maps);
  void BeginSets(Search& search);
  void CompareRow(Search& search, const KnownMaps& maps);
  void PlanMaps(Search& search) const;
  void MatchMapsNext(Search& search, const KnownMaps& maps, FieldCache& fields);
  std::vector<Accepted> Finish(Search& search);

  std::map<AgentId, SearchedRover> rovers_;
  std::vector<Search> searches_;  // The present one last.
  SubmapMatcher matcher_;
  std::list<std::pair<std::uint64_t, std::shared_ptr<const SubmapTemplate>>> templates_;  // The last used first.
  std::map<AgentPair, std::map<WindowPair, std::vector<SubmapPlace>>> places_;
  std::map<AgentPair, JudgedStart> judged_;
  std::map<AgentPair, std::vector<std::uint64_t>> judged_windows_;  // The windows that a verdict is about.
};

}  // namespace moondb
