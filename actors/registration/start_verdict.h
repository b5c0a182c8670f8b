// StartVerdict: decides whether a set of places (submap_sets.h) shows where one rover lies in the frame of another.
//
// A set that fits where it was found may still be wrong, because rooms look alike. Therefore all submaps of both rovers
// are compared at the solved poses, not only those of the set, and the set must be better than any other one. If two
// sets would be accepted alone, neither is: two equal rooms or buildings differ only in how much of them was seen.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "actors/registration/submap_matching.h"
#include "actors/registration/submap_sets.h"

namespace moondb {

// How submaps of two rovers fit at the poses of a set.
class SetFit {
 public:
  // Adds a pair of submaps. Their offset may move within the uncertainty of the solved poses: where the rovers are far
  // from a place of the set, the odometry says only roughly how the submaps lie.
  void Add(const SubmapGraph& solved, std::size_t first_pose, std::size_t second_pose, const Submap& first,
           const Submap& second);

  // Returns whether two submaps are near enough for Add to compare them.
  static bool MayOverlap(const SubmapGraph& solved, std::size_t first_pose, std::size_t second_pose);

  // Parts of the points of both rovers that lie in the other's known area.
  double matched() const { return Part(matched_); }
  double contradicted() const { return Part(contradicted_); }
  bool has_common() const { return common_ > 0; }

 private:
  double Part(int count) const { return common_ == 0 ? 0 : static_cast<double>(count) / common_; }

  int common_ = 0;
  int matched_ = 0;
  int contradicted_ = 0;
};

// The condition that failed.
enum class StartVerdict {
  kAccepted,
  kNoPlace,     // No two submaps fit.
  kFewSubmaps,  // The set has no two submaps of each rover that lie 4 m apart.
  kUncertain,   // The standard deviation of a position is too large.
  kLittleEvidence,
  kRival,         // Another set has nearly as much evidence.
  kContradicted,  // The maps of both rovers contradict each other at the solved poses.
  kFewMaps,       // Too few single maps match at the solved poses.
};

// The figures of a set that decide.
struct JudgedSet {
  double evidence = 0;
  double matched = 0;
  double contradicted = 0;
  double sigma_m = 0;
  double span_m = 0;  // Largest distance of two of its submaps of one rover; of the rover with less.
};

// Two submaps of different rovers, and where the second lies in the first.
struct PlacedSubmaps {
  SubmapNodes first;
  SubmapNodes second;
  PlanarOffset first_from_second;
};

struct JudgedStart {
  StartVerdict verdict = StartVerdict::kNoPlace;
  JudgedSet best;
  double rival = 0;                    // Evidence of the best other set.
  std::optional<PlacedSubmaps> place;  // The most evident one of the best set.
};

// Returns the most evident place of a set. `all`: where it comes from.
PlacedSubmaps BestPlaceOf(const SubmapSet& set, const SubmapSets& all);

// Returns the figures of a set. `fit`: of all submaps at its poses. `all`: where it comes from.
JudgedSet FiguresOf(const SubmapSet& set, const SetFit& fit, const SubmapSets& all);

// Judges the first of the sets, which has the most evidence.
JudgedStart JudgeSets(const std::vector<JudgedSet>& sets);

// Returns "accepted", "another place fits nearly as well", ...
std::string ToString(StartVerdict verdict);

// Returns what an operator can do about it: "drive one of them ...". Empty if accepted.
std::string RemedyOf(StartVerdict verdict);

}  // namespace moondb
