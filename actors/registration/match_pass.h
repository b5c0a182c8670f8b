// MatchPass: the pairs of maps of one pass, and the progress through them. Not thread-safe.
#pragma once

#include <cstddef>
#include <vector>

#include "actors/registration/match_plan.h"
#include "model/check.h"

namespace moondb {

class MatchPass {
 public:
  void Clear() { *this = MatchPass(); }
  void Begin(std::vector<PlannedMatch> pairs) {
    is_begun_ = true;
    pairs_ = std::move(pairs);
    matched_count_ = 0;
  }
  bool is_begun() const { return is_begun_; }
  bool is_empty() const { return pairs_.empty(); }
  std::size_t left_count() const { return pairs_.size() - matched_count_; }
  // Returns the next pair. Requires: left_count() is not 0.
  const PlannedMatch& Next() {
    Check(left_count() > 0, "a pair is left");
    return pairs_[matched_count_++];
  }

 private:
  bool is_begun_ = false;
  std::vector<PlannedMatch> pairs_;
  std::size_t matched_count_ = 0;  // Number of pairs_ that Next has returned.
};

}  // namespace moondb
