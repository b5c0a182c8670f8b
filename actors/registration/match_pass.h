// MatchPass: the pairs of maps of one pass, and the progress through them. Not thread-safe.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/registration/match_plan.h"
#include "model/check.h"

namespace moondb {

class MatchPass {
 public:
  struct Pair {
    const PlannedMatch& planned;
    bool is_start;  // The pair belongs to the search for an unknown start.
  };

  void Clear() { *this = MatchPass(); }
  // `starts`: the pairs of the search for unknown starts, which come last.
  void Begin(std::vector<PlannedMatch> pairs, std::vector<PlannedMatch> starts) {
    is_begun_ = true;
    start_begin_ = pairs.size();
    pairs_ = std::move(pairs);
    for (PlannedMatch& planned : starts) pairs_.push_back(std::move(planned));
    matched_count_ = 0;
  }
  bool is_begun() const { return is_begun_; }
  bool is_empty() const { return pairs_.empty(); }
  std::size_t left_count() const { return pairs_.size() - matched_count_; }
  // Returns the next pair. Requires: left_count() is not 0.
  Pair Next() {
    Check(left_count() > 0, "a pair is left");
    const std::size_t index = matched_count_++;
    return {pairs_[index], index >= start_begin_};
  }

 private:
  bool is_begun_ = false;
  std::vector<PlannedMatch> pairs_;
  std::size_t matched_count_ = 0;  // Number of pairs_ that Next has returned.
  std::size_t start_begin_ = 0;    // Index of the first pair of the search for unknown starts.
};

}  // namespace moondb
