#include "runtime/supervisor.h"

#include <algorithm>

namespace moondb {

std::optional<Duration> Supervisor::OnFailure(MonotonicTime now) {
  while (!failures_.empty() && now - failures_.front() >= options_.restart_period) failures_.pop_front();
  if (static_cast<int>(failures_.size()) >= options_.restarts_max) return std::nullopt;
  Duration delay{};
  if (!failures_.empty()) delay = options_.first_delay;
  for (std::size_t i = 1; i < failures_.size() && delay < options_.delay_max; ++i) delay *= 2;
  failures_.push_back(now);
  return std::min(delay, options_.delay_max);
}

}  // namespace moondb
