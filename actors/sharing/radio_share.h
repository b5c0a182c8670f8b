// RadioShare: what one sharing actor knows of the sessions that share this agent's radio, and what each of them gets of
// its budget.
//
// All sessions that are moving have equal parts: in both directions, and those of the agent's other sharing actor. The
// two actors notify each other of how many they have whenever that changes. Plain value.
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

  // As the other sharing actor says.
  void SetMovingElsewhere(std::size_t moving) {
    moving_elsewhere_ = moving;
    // The other actor may have begun anew, and not know of this one's sessions.
    if (moving == 0 && notified_.value_or(0) > 0) notified_.reset();
  }
  std::size_t moving_elsewhere() const { return moving_elsewhere_; }

  // The other sharing actor does not know yet that so many of this one's sessions are moving.
  bool MustNotify(std::size_t moving) const { return notified_ != moving; }
  void NoteNotified(std::size_t moving) { notified_ = moving; }

 private:
  double bytes_per_second_;
  std::size_t moving_elsewhere_ = 0;
  std::optional<std::size_t> notified_;  // What the other sharing actor heard of this one last.
};

}  // namespace moondb
