#include "runtime/supervisor.h"

#include <algorithm>

namespace moondb {

Supervisor::Verdict Supervisor::OnFailure(const Error& failure, MonotonicTime now, double jitter) {
  if (failure.code == ErrorCode::kCorrupt) return {Action::kBeyondHelp, {}};
  while (!failures_.empty() && now - failures_.front() >= options_.restart_period) failures_.pop_front();
  if (failures_.empty()) has_stepped_down_ = false;
  Verdict verdict;
  if (static_cast<int>(failures_.size()) >= options_.restarts_max) {
    if (has_stepped_down_ || !options_.can_step_down) return {Action::kBeyondHelp, {}};
    has_stepped_down_ = true;
    failures_.clear();
    verdict.action = Action::kStepDown;
  }
  const double factor = 1 + options_.jitter_ratio * (2 * jitter - 1);
  verdict.delay = std::chrono::duration_cast<Duration>(NextDelay() * factor);
  failures_.push_back(now);
  return verdict;
}

Duration Supervisor::NextDelay() const {
  // Use a long delay that still allows `restarts_max` restarts within the period.
  if (has_stepped_down_) return std::min(options_.delay_max, options_.restart_period / (2 * options_.restarts_max));
  if (failures_.empty()) return Duration::zero();
  Duration delay = options_.first_delay;
  for (std::size_t i = 1; i < failures_.size() && delay < options_.delay_max; ++i) delay *= 2;
  return std::min(delay, options_.delay_max);
}

}  // namespace moondb
