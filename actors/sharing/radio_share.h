// RadioShare: divides this agent's radio budget among the sessions that use the radio.
//
// All moving sessions get equal parts: incoming and outgoing sessions, of this sharing actor and of the agent's other
// sharing actor. The two actors notify each other whenever their number of moving sessions changes. Plain value.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>

namespace moondb {

class RadioShare {
 public:
  // `bytes_per_second` 0: there is no budget, for example in tests.
  explicit RadioShare(double bytes_per_second) : bytes_per_second_(bytes_per_second) {}

  bool is_limited() const { return bytes_per_second_ > 0; }
  // Returns the bytes per second for each session, if `moving` sessions of this actor use the radio.
  double Part(std::size_t moving) const {
    return bytes_per_second_ / static_cast<double>(std::max<std::size_t>(moving + moving_elsewhere_, 1));
  }

  // Sets the number of moving sessions that the other sharing actor reported.
  void SetMovingElsewhere(std::size_t moving) {
    moving_elsewhere_ = moving;
    // The other actor may have restarted and forgotten the number of this actor's sessions. Notify it again.
    if (moving == 0 && notified_.value_or(0) > 0) notified_.reset();
  }
  std::size_t moving_elsewhere() const { return moving_elsewhere_; }

  // True unless this number of moving sessions is the last one of which the other sharing actor was notified.
  bool MustNotify(std::size_t moving) const { return notified_ != moving; }
  void NoteNotified(std::size_t moving) { notified_ = moving; }

 private:
  double bytes_per_second_;
  std::size_t moving_elsewhere_ = 0;
  std::optional<std::size_t> notified_;  // The number of which the other sharing actor was last notified.
};

}  // namespace moondb
