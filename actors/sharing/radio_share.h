// RadioShare: one sharing actor's knowledge of who shares this agent's radio, and what each session gets of its budget.
//
// All sessions that are moving have equal parts: in both directions, and those of the agent's other sharing actor,
// which tells how many it has whenever that changes. Plain value.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>

namespace moondb {

class RadioShare {
 public:
  // 0: there is no budget, as in tests.
  explicit RadioShare(double bytes_per_second) : bytes_per_second_(bytes_per_second) {}

  bool is_limited() const { return bytes_per_second_ > 0; }
  // Bytes a second of each session, when so many of this actor's are moving.
  double Part(std::size_t moving) const {
    return bytes_per_second_ / static_cast<double>(std::max<std::size_t>(moving + moving_elsewhere_, 1));
  }

  // What the other sharing actor tells.
  void HearElsewhere(std::size_t moving) {
    moving_elsewhere_ = moving;
    // It may have begun anew, and not know this actor's.
    if (moving == 0 && told_.value_or(0) > 0) told_.reset();
  }
  std::size_t moving_elsewhere() const { return moving_elsewhere_; }

  bool MustTell(std::size_t moving) const { return told_ != moving; }
  void NoteTold(std::size_t moving) { told_ = moving; }

 private:
  double bytes_per_second_;
  std::size_t moving_elsewhere_ = 0;
  std::optional<std::size_t> told_;  // To the other sharing actor, last.
};

}  // namespace moondb
