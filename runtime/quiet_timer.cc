#include "runtime/quiet_timer.h"

#include <algorithm>
#include <utility>

namespace moondb {

void QuietTimer::OnNews(Context& context) {
  newest_news_ = context.now();
  if (std::exchange(is_running_, true)) return;
  oldest_news_ = newest_news_;
  (void)context.AfterTimer(options_.quiet, options_.kind);
}

bool QuietTimer::OnTimer(Context& context, bool is_busy) {
  MonotonicTime due = newest_news_ + options_.quiet;
  if (options_.wait_max != Duration::max()) due = std::min(due, oldest_news_ + options_.wait_max);
  if (last_due_) due = std::max(due, *last_due_ + options_.apart);
  if (is_busy) due = std::max(due, context.now() + options_.quiet);
  is_running_ = context.now() < due;
  if (is_running_) {
    (void)context.AfterTimer(due - context.now(), options_.kind);
  } else {
    last_due_ = context.now();
  }
  return !is_running_;
}

}  // namespace moondb
