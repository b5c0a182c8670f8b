// RadioShare: divides this agent's radio budget equally among its moving sessions, which are the sessions that use the
// radio now.
//
// The budget is shared by incoming and outgoing sessions of SyncActor and ReplicaActor. The two actors notify each
// other whenever their number of moving sessions changes. Plain value.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>

namespace moondb {

class RadioShare {
 public:
  // `bytes_per_second`: the agent's radio budget; 0: no limit, for example in tests.
  explicit RadioShare(double bytes_per_second) : bytes_per_second_(bytes_per_second) {}

  bool is_limited() const { return bytes_per_second_ > 0; }
  // Returns each session's part in bytes per second, if `moving` sessions of this actor use the radio.
  double Part(std::size_t moving) const {
    return bytes_per_second_ / static_cast<double>(std::max<std::size_t>(moving + moving_elsewhere_, 1));
  }

  // Sets how many sessions of the other sharing actor use the radio now, as reported by that actor.
  void SetMovingElsewhere(std::size_t moving) {
    moving_elsewhere_ = moving;
    // The other actor may have restarted and forgotten this actor's number, so make MustNotify return true.
    if (moving == 0 && notified_.value_or(0) > 0) notified_.reset();
  }
  std::size_t moving_elsewhere() const { return moving_elsewhere_; }

  // Returns true if the last notification to the other sharing actor contained another number than `moving`, or if
  // there was no notification yet.
  bool MustNotify(std::size_t moving) const { return notified_ != moving; }
  void ObserveNotified(std::size_t moving) { notified_ = moving; }

 private:
  double bytes_per_second_;
  std::size_t moving_elsewhere_ = 0;
  std::optional<std::size_t> notified_;  // Number of sessions in the last notification to the other actor.
};

}  // namespace moondb
