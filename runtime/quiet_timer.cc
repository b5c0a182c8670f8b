#include "runtime/quiet_timer.h"

#include <algorithm>
#include <utility>

namespace moondb {

void QuietTimer::OnNews(Context& context) {
  newest_news_ = context.now();
  if (std::exchange(has_news_, true)) return;
  oldest_news_ = newest_news_;
  if (!std::exchange(is_armed_, true)) (void)context.AfterTimer(options_.quiet, options_.kind);
}

bool QuietTimer::OnTimer(Context& context, bool is_busy) {
  is_armed_ = false;
  if (!has_news_) return false;
  MonotonicTime due = newest_news_ + options_.quiet;
  if (options_.wait_max != Duration::max()) due = std::min(due, oldest_news_ + options_.wait_max);
  if (last_due_) due = std::max(due, *last_due_ + options_.apart);
  if (is_busy) due = std::max(due, context.now() + options_.quiet);
  has_news_ = is_armed_ = context.now() < due;
  if (is_armed_) {
    (void)context.AfterTimer(due - context.now(), options_.kind);
  } else {
    last_due_ = context.now();
  }
  return !is_armed_;
}

}  // namespace moondb
